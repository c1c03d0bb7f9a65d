"""What predictions leave over, small enough to draw: over time, against amplitude, over frequency, and where most is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array, Recording
from lab.diagnosis.outcome import Diagnosis, Prediction, SpectralPrediction
from lab.show.signals import Spectra, spectra

MODELS = ("nominal", "calibrated", "extended")
LABELS = {
    "measured": "measured",
    "nominal": "as given",
    "calibrated": "calibrated",
    "extended": "extended",
}
"""What legends call the signals."""
N_WINDOWS = 60
"""Stretches into which all records together are cut."""

CLOSE_UP = 150
"""Samples of a close-up."""
MAX_ROWS = 6
"""Spectra shown."""


@dataclass(frozen=True, eq=False)
class Levels:
    """RMS over short stretches of one record.

    Attributes:
        time: middle of each stretch, from the start of the record, shape (n_windows,) [s].
        measured: of the outputs, (n_outputs, n_windows).
        residual: of what each model leaves, by its name, likewise.
    """

    time: Array
    measured: Array
    residual: dict[str, Array]


@dataclass(frozen=True)
class Leftover:
    """Where the extended model errs most.

    Attributes:
        channel: output with the largest error relative to its signal.
        error: that error, RMS over RMS.
        record: number of the record in which it is largest.
        time: of the stretch in which it is largest, in that record [s].
        frequency_hz: at which its density is largest; None where there is no spectrum.
        growth: RMS of the error while the channel moves most (a quarter of the stretches) over that while it moves
            least.
    """

    channel: str
    error: float
    record: int
    time: tuple[float, float]
    frequency_hz: float | None
    growth: float


def shown_models(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Models worth a line of their own: without findings the extended model is the calibrated one."""
    return MODELS if diagnosis.findings else MODELS[:2]


def residual(prediction: Prediction, model: str) -> Array:
    """Measured less predicted outputs, (n_outputs, n_samples); NaN where a sample is missing."""
    return np.asarray(prediction.measured - getattr(prediction, model))


def rms(signals: Sequence[Array]) -> Array:
    """RMS of each row over all signals together, missing samples left out; 0 for a row without any."""
    squares = sum(np.nansum(signal**2, axis=1) for signal in signals)
    counts = sum(np.sum(np.isfinite(signal), axis=1) for signal in signals)
    return np.sqrt(squares / np.maximum(counts, 1))


def signal_rms(diagnosis: Diagnosis) -> Array:
    """RMS of each measured output over all records, shape (n_outputs,)."""
    return rms([prediction.measured for prediction in diagnosis.predictions])


def relative_errors(diagnosis: Diagnosis, model: str) -> Array:
    """RMS error over RMS signal of each output on samples kept aside (on all where none were), (n_outputs,)."""
    parts = [(p, p.first_held_out) for p in diagnosis.predictions if p.first_held_out < p.measured.shape[1]]
    parts = parts or [(p, 0) for p in diagnosis.predictions]
    error = rms([residual(p, model)[:, first:] for p, first in parts])
    signal = rms([p.measured[:, first:] for p, first in parts])
    return np.divide(error, signal, out=np.zeros_like(error), where=signal > 0)


def worst_stretch(diagnosis: Diagnosis, n_samples: int) -> tuple[int, int]:
    """Record in which the model as given errs most, and the sample in it where a close-up begins.

    The close-up is where the calibrated model errs most, within the samples kept aside.
    """
    scale = signal_rms(diagnosis)
    scale = np.where(scale > 0, scale, 1.0)
    sizes = [np.max(rms([residual(p, "nominal")]) / scale) for p in diagnosis.predictions]
    number = int(np.argmax(sizes))
    prediction = diagnosis.predictions[number]
    n = prediction.measured.shape[1]
    first = min(prediction.first_held_out, max(0, n - n_samples))
    power = np.nansum((residual(prediction, "calibrated") / scale[:, None]) ** 2, axis=0)[first:]
    if power.size <= n_samples:
        return number, first
    total = np.concatenate([[0.0], np.cumsum(power)])
    return number, first + int(np.argmax(total[n_samples:] - total[:-n_samples]))


def levels(diagnosis: Diagnosis, sample_rate: float) -> list[Levels]:
    """RMS of outputs and residuals over short stretches of every record."""
    total = sum(p.measured.shape[1] for p in diagnosis.predictions)
    size = max(1, -(-total // N_WINDOWS))
    found = []
    for p in diagnosis.predictions:
        starts = np.arange(0, p.measured.shape[1], size)
        ends = np.minimum(starts + size, p.measured.shape[1])
        residuals = {model: _stretches(residual(p, model), starts) for model in MODELS}
        found.append(Levels((starts + ends) / (2 * sample_rate), _stretches(p.measured, starts), residuals))
    return found


def _stretches(signal: Array, starts: NDArray[np.intp]) -> Array:
    """RMS of the samples from each start to the next; NaN where all are missing."""
    if not starts.size:
        return np.zeros((signal.shape[0], 0))
    squares = np.add.reduceat(np.nan_to_num(signal) ** 2, starts, axis=1)
    counts = np.add.reduceat(np.isfinite(signal).astype(float), starts, axis=1)
    return np.sqrt(np.divide(squares, counts, out=np.full_like(squares, np.nan), where=counts > 0))


def residual_spectra(diagnosis: Diagnosis, recording: Recording, model: str) -> Spectra | None:
    """Spectral densities of what a model leaves; None when no stretch is complete and long enough."""
    records = tuple(
        replace(record, outputs=residual(prediction, model))
        for record, prediction in zip(recording.records, diagnosis.predictions, strict=True)
    )
    return spectra(replace(recording, records=records))


def leftover(diagnosis: Diagnosis, recording: Recording) -> Leftover:
    """Where the extended model errs most: channel, record, time, frequency, and whether it grows with the motion."""
    errors = relative_errors(diagnosis, "extended")
    row = int(np.argmax(errors))
    parts = levels(diagnosis, recording.sample_rate)
    left = [part.residual["extended"][row] for part in parts]
    largest = [float(np.nanmax(part, initial=0.0)) for part in left]
    record = int(np.argmax(largest))
    window = int(np.argmax(np.nan_to_num(left[record])))
    middle = parts[record].time
    # Stretches are equally long except the last of a record.
    half = float(middle[0])
    end = diagnosis.predictions[record].measured.shape[1] / recording.sample_rate
    spectrum = residual_spectra(diagnosis, recording, "extended")
    frequency = None
    if spectrum is not None:
        frequency = float(spectrum.frequency_hz[1 + int(np.argmax(spectrum.output_density[row, 1:]))])
    return Leftover(
        recording.outputs[row].name,
        float(errors[row]),
        record,
        (2 * half * window, min(2 * half * (window + 1), end)),
        frequency,
        _growth(np.concatenate([part.measured[row] for part in parts]), np.concatenate(left)),
    )


def _growth(motion: Array, error: Array) -> float:
    """RMS error in the liveliest quarter of the stretches over that in the calmest; 1 where it cannot be told."""
    known = np.isfinite(motion) & np.isfinite(error)
    motion, error = motion[known], error[known]
    quarter = motion.size // 4
    if not quarter:
        return 1.0
    order = np.argsort(motion, kind="stable")
    calm, lively = (np.sqrt(np.mean(error[part] ** 2)) for part in (order[:quarter], order[-quarter:]))
    return float(lively / calm) if calm > 0 else 1.0


def worst_rows(spectra: SpectralPrediction) -> list[int]:
    """Rows to show, in their order: those whose logarithm the calibrated model misses most."""
    tiny = 1e-300
    error = np.log(np.maximum(spectra.measured, tiny)) - np.log(np.maximum(spectra.calibrated, tiny))
    order = np.argsort(-np.mean(error**2, axis=1), kind="stable")
    return sorted(int(row) for row in order[:MAX_ROWS])
