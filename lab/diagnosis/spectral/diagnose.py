"""Diagnose spectra: what a model gets wrong where no force was measured, or where only frequency responses are known."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from identification.progress import Progress, Work
from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.diagnosis.calibrate import Calibration, parameters_of
from lab.diagnosis.candidate import Candidate
from lab.diagnosis.conclude import calibrated_rig, calibration_of, effects_of
from lab.diagnosis.outcome import (
    CONSISTENT,
    EXPLAINED,
    UNEXPLAINED,
    Alternative,
    Diagnosis,
    Errors,
    Finding,
    Quantity,
)
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.spectral.experiment import Experiment
from lab.diagnosis.spectral.fit import SpectralFit, fit
from lab.diagnosis.spectral.recorded import Recorded
from lab.diagnosis.spectral.responses import Responses
from lab.diagnosis.spectral.search import drifting, search
from lab.diagnosis.spectral.smallest import in_words, smallest_changes, smallest_drifts
from lab.diagnosis.spectral.stage import Stage, confirmed, predicted, settled, with_cause, without_idle
from lab.diagnosis.spectral.tones import FoundTone
from lab.diagnosis.state import State
from lab.diagnosis.words import FURTHER, advice, says
from lab.effects import EFFECTS
from lab.effects.effect import Effect
from lab.errors import LabError
from lab.rig import Rig
from lab.twin import twin

MOST_FINDINGS = 4
FAR = 3.0
"""Standard deviations beyond which a calibrated parameter may hide a cause, so that the model as given is a better start."""
NARROWEST = 1e-3
"""Relative width of a prior below which no baseline takes it: masses do change a little by themselves."""
RIGID = 1e12
"""Precision of a prior that lets a parameter not move."""


def diagnose_spectra(
    data: Recording | FrequencyResponse,
    rig: Rig,
    *,
    baseline: Recording | FrequencyResponse | None = None,
    widths: Mapping[str, float] | None = None,
    effects: Mapping[str, type[Effect]] = EFFECTS,
    band: tuple[float, float] | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """What the model gets wrong in spectra of outputs, or in frequency responses, and the model that does not.

    A recording is compared through its cross-spectra with the model under white forces, each held over a sample, on every
    degree of freedom, or where the recording's input channels say if it names any; their intensities and the noise of
    every channel are fitted along. Errors are relative errors of the spectral matrix, whitened by the model's own; those of
    responses are RMS over RMS.

    Args:
        data: outputs without measured forces, or frequency responses.
        rig: what the engineer believes; its channels must have the names of the data's.
        baseline: likewise, of the same rig in its known state; it calibrates the model first.
        widths: prior standard deviations, relative, by group ("mass", "stiffness", "damping") or parameter.
        effects: the causes that may be named, as far as such data can show them.
        band: lowest and highest frequency used [Hz]; all when None.
        progress: told what is being done, and the share of it that is done; it falls where the search goes on.

    Returns:
        The diagnosis, with `spectra` in place of predictions sample by sample.

    Raises:
        LabError: data and model do not fit together, or the data are too short.

    Source: Whittle (1953), Ark. Mat. 2, 423-434, for the likelihood; Schwarz (1978), Ann. Stat. 6, for the evidence.
    """
    work = Work(progress)
    rig = nominal = rig.connected(
        inputs=[channel.name for channel in data.inputs], outputs=[channel.name for channel in data.outputs]
    )
    model = twin(rig)
    parameters, lesson = parameters_of(model, widths), None
    if parameters.inputs:
        raise LabError(
            f"a width is given for {parameters.names[-1]!r}, and the data are spectra; expected a recording with measured "
            "forces, or responses whose scale is marked as unknown"
        )
    if baseline is not None:
        work("calibrating on the baseline", 0.0)
        known, lesson = _learned(_experiment(baseline, rig, band, share=1.0), rig, parameters)
        rig = calibrated_rig(known.likelihood, known.fit.theta, rig)
        parameters, model = _tightened(parameters, known.fit), twin(rig)
    work("calibrating", 0.05)
    stage = origin = _calibrated(_experiment(data, rig, band).after(lesson), rig, parameters)
    visible = {name: kind for name, kind in effects.items() if name in stage.experiment.visible}
    given = _as_given(stage.likelihood, stage.fit)
    # What changed since a baseline is better seen from there than from parameters that were moved to explain it.
    start = given if baseline is not None or np.max(np.abs(stage.fit.theta)) > FAR else None
    first: list[Candidate | FoundTone] = []
    refused: Candidate | FoundTone | None = None
    looks = 1
    while len(stage.accepted) < MOST_FINDINGS:
        number = FURTHER.get(len(stage.accepted), "first")
        work(f"searching for a {number} cause", 0.0 if stage.accepted else 0.45)
        ranked, looks = _ranked(stage, visible, start if not stage.accepted else None)
        if not ranked or ranked[0].gain < evidence_threshold(looks):
            break
        step = with_cause(stage, ranked[0])
        better = settled(stage, step)
        if better is not None:
            stage, origin = better, origin if stage.accepted else better
            continue
        if not confirmed(stage, step):
            refused = ranked[0]
            break
        first, stage = first or ranked, without_idle(step)
    work("predicting data kept aside", 0.75)
    told = _outcome(stage, origin, given, nominal, rig, first, refused)
    return replace(told, unlearnable=_too_small(stage, visible, evidence_threshold(looks)))


def evidence_threshold(looks: int) -> float:
    """2 log evidence that a cause must gain to be named when so many were looked at.

    Each cause pays log n per variable already (Schwarz 1978); the largest of many chance gains is covered by their number
    (Bonferroni), and a factor e⁵, decisive on Jeffreys' scale, is asked beyond.
    """
    return 2 * float(np.log(max(looks, 1))) + 10


def _too_small(stage: Stage, effects: Mapping[str, type[Effect]], needed: float) -> tuple[str, ...]:
    """How large a change must be for these data to name it, one sentence each."""
    sizes = smallest_changes(stage.likelihood, stage.fit, needed)
    sizes = {cause: each for cause, each in sizes.items() if cause in effects}
    if "stiffness_drift" not in effects or any(c.cause == "stiffness_drift" for c in stage.accepted):
        return in_words(sizes, [])
    parts = stage.experiment.in_parts(stage.likelihood)
    drift = effects["stiffness_drift"]
    return in_words(sizes, None if parts is None else smallest_drifts(parts, stage.fit, drift, needed))


def _experiment(
    data: Recording | FrequencyResponse,
    rig: Rig,
    band: tuple[float, float] | None,
    share: float | None = None,
) -> Experiment:
    if isinstance(data, FrequencyResponse):
        return Responses.of(data, band=band, whole=share == 1.0)
    model = twin(rig)
    return Recorded.of(data, rig, model, band=band, **({} if share is None else {"share": share}))


def _calibrated(experiment: Experiment, rig: Rig, parameters: Parameters) -> Stage:
    """The model's own parameters at their most likely values, without any cause."""
    likelihood = experiment.likelihood(twin(rig), parameters, rig)
    found = fit(likelihood, np.zeros(parameters.n), (), likelihood.nuisance_mean)
    weighted = experiment.weighted(likelihood, predicted(likelihood, found))
    if weighted is not experiment:
        experiment, likelihood = weighted, weighted.again(likelihood)
        found = fit(likelihood, found.theta, (), found.nuisance)
    likelihood = experiment.surveyed(likelihood, found.nuisance)
    return Stage(experiment, likelihood, found, (), ())


def _learned(experiment: Experiment, rig: Rig, parameters: Parameters) -> tuple[Stage, Any | None]:
    """The model calibrated on a baseline, its error bars aware of how the model errs there, and that."""
    stage = _calibrated(experiment, rig, parameters)
    lesson = stage.experiment.lesson_of(stage.likelihood, predicted(stage.likelihood, stage.fit))
    if lesson is not None:
        likelihood = lesson.heeded(stage.likelihood)
        wider = fit(likelihood, stage.fit.theta, (), stage.fit.nuisance, iterations=0)
        stage = replace(stage, likelihood=likelihood, fit=wider)
    return stage, lesson


def _tightened(parameters: Parameters, known: SpectralFit) -> Parameters:
    """The parameters with prior widths shrunk to how far each may move before the baseline contradicts.

    Widths are independent, and of all independent priors this one is closest to what the baseline leaves: what moves a
    resonance stays known, although the baseline does not say which of many stiffnesses brings it where it is.

    Source: Bishop (2006), Pattern Recognition and Machine Learning, section 10.1.2, precisions of the factorized Gaussian.
    """
    n = parameters.n
    spread = 1 / np.sqrt(np.diag(known.information)[:n] + np.diag(known.precision))
    shrunk = np.maximum(parameters.widths * np.minimum(spread, 1.0), NARROWEST)
    return replace(parameters, widths=np.minimum(shrunk, parameters.widths))


def _ranked(
    stage: Stage, effects: Mapping[str, type[Effect]], start: SpectralFit | None
) -> tuple[list[Candidate | FoundTone], int]:
    """Candidates for one more cause, best first, and how many were looked at."""
    anchors = [] if start is None else [start]
    steady = {
        name: kind
        for name, kind in effects.items()
        if name not in ("stiffness_drift", "unmeasured_force", "line_hum")
    }
    # Where nothing is left that chance does not explain, no large change can hide.
    large = bool(stage.experiment.left(stage.likelihood, predicted(stage.likelihood, stage.fit)))
    candidates, looks = search(stage.likelihood, stage.fit, steady, anchors=anchors, large=large)
    tones, places = stage.experiment.tones(stage.likelihood, stage.fit, effects)
    parts = stage.experiment.in_parts(stage.likelihood) if "stiffness_drift" in effects else None
    drifts, springs = ([], 0) if parts is None else drifting(parts, stage.fit, effects["stiffness_drift"])
    found: list[Candidate | FoundTone] = [*candidates, *tones, *drifts]
    return sorted(found, key=lambda c: -c.gain), looks + places + springs


def _as_given(likelihood: Any, found: SpectralFit) -> SpectralFit:
    """The model as given: no parameter moves, only what it cannot know is fitted."""
    rigid = replace(likelihood.parameters, precision=RIGID * np.eye(found.theta.size))
    return fit(
        replace(likelihood, parameters=rigid), np.zeros(found.theta.size), (), likelihood.nuisance_mean
    )


def _named(stage: Stage) -> list[tuple[Candidate | FoundTone, Effect, Mapping[str, Quantity]]]:
    """The accepted causes at their fitted size, with error bars."""
    candidates = tuple(c for c in stage.accepted if isinstance(c, Candidate))
    fitted = iter(effects_of(_state(stage, candidates)))
    return [(c, c.effect, c.parameters) if isinstance(c, FoundTone) else next(fitted) for c in stage.accepted]


def _state(stage: Stage, accepted: tuple[Candidate, ...]) -> State:
    """The stage as a diagnosis sample by sample keeps it: names are the same, and what is asked of it is there."""
    found: Any = stage.fit
    return State(Calibration(stage.likelihood, found, found, 0.0), found, accepted, found, ())


def _outcome(
    stage: Stage,
    origin: Stage,
    given: SpectralFit,
    nominal: Rig,
    rig: Rig,
    first: list[Candidate | FoundTone],
    refused: Candidate | FoundTone | None,
) -> Diagnosis:
    named = _named(stage)
    extended = calibrated_rig(stage.likelihood, stage.fit.theta, rig)
    for c, effect, _ in named:
        if isinstance(c, FoundTone) or c.direction is None:
            extended = effect.apply(extended)
    kept = origin.experiment.held_out(origin.likelihood)
    clean = stage.experiment.held_out(stage.likelihood)
    shown = (predicted(kept, given), predicted(kept, origin.fit), predicted(clean, stage.fit))
    floor = stage.experiment.floor(clean, shown[2])
    errors = Errors(
        floor,
        origin.experiment.error(kept, shown[0]),
        origin.experiment.error(kept, shown[1]),
        stage.experiment.error(clean, shown[2]),
    )
    shares = _shares(stage.held_out, floor)
    findings = [
        Finding(effect, quantities, 0.5 * c.gain, share, says(effect, quantities))
        for (c, effect, quantities), share in zip(named, shares, strict=True)
    ]
    warnings = stage.experiment.warnings(stage.likelihood, origin.likelihood)
    left = stage.experiment.left(stage.likelihood, predicted(stage.likelihood, stage.fit))
    if refused is not None and not left:
        left = (
            f"something is left: the training data speak for {refused.cause} at {refused.location} (log evidence "
            f"{0.5 * refused.gain:.3g}), and the data kept aside against it"
        )
    return Diagnosis(
        UNEXPLAINED if left else EXPLAINED if findings else CONSISTENT,
        tuple(sorted(findings, key=lambda f: -f.holdout_gain)),
        _alternatives(first) if findings else (),
        calibration_of(_state(stage, ())),
        errors,
        (),
        nominal,
        extended,
        tuple([left, *warnings] if left else warnings),
        spectra=origin.experiment.shown(kept, shown),
    )


def _shares(errors: tuple[float, ...], floor: float) -> list[float]:
    """Share of the calibrated model's excess error on data kept aside that each cause removed, 0 to 1."""
    if not errors:
        return []
    excess = max(errors[0] - floor, 1e-12)
    return [float(np.clip((a - b) / excess, 0.0, 1.0)) for a, b in itertools.pairwise(errors)]


def _alternatives(first: list[Candidate | FoundTone]) -> tuple[Alternative, ...]:
    """The next best explanations of the first finding."""
    told = first[0]
    return tuple(
        Alternative(
            c.cause, c.location, 0.5 * c.gain, advice(told.cause, c.cause, 0.5 * (told.gain - c.gain))
        )
        for c in first[1:6]
        if c.gain > 0
    )
