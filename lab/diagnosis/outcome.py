"""Outcome: what a diagnosis says, ready for JSON, report and viewer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from identification.recording import Array
from lab.effects.effect import Effect
from lab.rig import Rig

CONSISTENT, EXPLAINED, UNEXPLAINED = "consistent", "explained", "unexplained"


@dataclass(frozen=True)
class Quantity:
    """A value with one standard deviation and its unit."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True, eq=False)
class Finding:
    """A cause that the data name.

    Attributes:
        effect: the cause at its place with its size.
        parameters: by name.
        log_evidence_gain: of the model with it over the model without it, natural logarithm.
        holdout_gain: share of the calibrated model's excess error on data kept aside that it removes, 0 to 1.
        says: one sentence for an engineer.
    """

    effect: Effect
    parameters: Mapping[str, Quantity]
    log_evidence_gain: float
    holdout_gain: float
    says: str


@dataclass(frozen=True)
class Alternative:
    """Another explanation of the first finding.

    Attributes:
        cause, location: of the other explanation.
        log_evidence_gain: of the model with it over the model without any, natural logarithm.
        advice: which measurement would tell the two apart, where these data hardly do.
    """

    cause: str
    location: str
    log_evidence_gain: float
    advice: str = ""


@dataclass(frozen=True)
class Calibrated:
    """A parameter that the model has already: nominal value, calibrated value and one standard deviation."""

    nominal: float
    value: float
    std: float


@dataclass(frozen=True)
class Errors:
    """RMS error over RMS signal, all outputs, on data kept out of every fit; simulated by MuJoCo."""

    noise_floor: float
    nominal: float
    calibrated: float
    extended: float


@dataclass(frozen=True, eq=False)
class Prediction:
    """Measured outputs and those of the three models, one record, (n_outputs, n_samples) each."""

    measured: Array
    nominal: Array
    calibrated: Array
    extended: Array
    first_held_out: int


@dataclass(frozen=True, eq=False)
class SpectralPrediction:
    """Spectra kept out of every fit and those of the three models, one row per channel or per pair of channels.

    Attributes:
        frequency_hz: (n_frequencies,).
        measured, nominal, calibrated, extended: power spectral densities, or magnitudes of responses, (n_rows, n_frequencies).
        names: of the rows.
        units: of the rows.
    """

    frequency_hz: Array
    measured: Array
    nominal: Array
    calibrated: Array
    extended: Array
    names: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What the model gets wrong, and the model that does not.

    Attributes:
        verdict: consistent, explained or unexplained.
        findings: in order of the gain each brings.
        alternatives: of the first finding, best first.
        calibration: parameters of the model by name.
        errors: on data kept aside.
        predictions: one per record; none where the data are spectra.
        nominal: the rig as given.
        extended: the rig calibrated and with the findings.
        warnings: what a careful reader should know, one sentence each.
        spectra: where the data are spectra or frequency responses.
        noise: of each output, by channel: RMS of what its own past does not foretell.
        unlearnable: what these data cannot tell, one sentence each.
    """

    verdict: str
    findings: tuple[Finding, ...]
    alternatives: tuple[Alternative, ...]
    calibration: Mapping[str, Calibrated]
    errors: Errors
    predictions: tuple[Prediction, ...]
    nominal: Rig
    extended: Rig
    warnings: tuple[str, ...]
    spectra: SpectralPrediction | None = None
    noise: Mapping[str, Quantity] = field(default_factory=dict)
    unlearnable: tuple[str, ...] = ()
