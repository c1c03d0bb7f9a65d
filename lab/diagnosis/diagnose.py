"""Diagnose: what a model gets wrong, why, the extended model, and the gain; the whole flow on one page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from identification.progress import Progress, Work
from identification.recording import Array, Recording
from lab.diagnosis.advance import (
    LAW_SUBSTEPS,
    finely,
    tried_again,
    with_better,
    with_better_names,
    with_cause,
    without_idle,
)
from lab.diagnosis.baseline import Baseline
from lab.diagnosis.bending import bent
from lab.diagnosis.calibrate import calibrate, parameters_of
from lab.diagnosis.candidate import Candidate
from lab.diagnosis.changes import OWN_CHANGES
from lab.diagnosis.check import living
from lab.diagnosis.conclude import calibrated_rig, conclude, nominal_ahead
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.fit import Fit
from lab.diagnosis.gain import held_out_error
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.outcome import Diagnosis
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.revise import settled
from lab.diagnosis.search import search
from lab.diagnosis.starts import free_decays, with_starts
from lab.diagnosis.state import State
from lab.diagnosis.tolerance import wrong_parameters
from lab.diagnosis.whiteness import Whiteness, patches, whiteness
from lab.diagnosis.words import FURTHER
from lab.effects import EFFECTS
from lab.effects.effect import Effect
from lab.errors import LabError
from lab.rig import Rig
from lab.twin import twin

MOST_FINDINGS = 4
UNSETTLED = 30.0
"""-2 log posterior by which a fit must fall to be taken for one that had not converged."""
RUNS_AWAY = 2.0
"""Error over signal that no bounded motion reaches, however little it has to do with the measured one."""
COSTS = 2.0, 9.0, 2.0, 4.0
"""Of calibration, search, refits with what was found, and conclusions, as measured."""


def diagnose(
    recording: Recording,
    rig: Rig,
    *,
    baseline: Recording | None = None,
    widths: Mapping[str, float] | None = None,
    effects: Mapping[str, type[Effect]] = EFFECTS,
    progress: Progress | None = None,
) -> Diagnosis:
    """What the model gets wrong in this recording, and the model that does not.

    Args:
        recording: measured outputs and inputs; outputs that never change are left out.
        rig: what the engineer believes; its channels must have the names of the recording's.
        baseline: of the same rig in its known state; it calibrates the model first.
        widths: prior standard deviations, relative, by group ("mass", "stiffness", "damping", "gain") or parameter; gains of
            inputs are known exactly where no width is given.
        effects: the causes that may be named.
        progress: told what is being done, and the share of it that is done; it falls where the search goes on.

    Raises:
        LabError: recording and model do not fit together, or the recording has no measured input.
    """
    recording, left_out = living(recording, baseline)
    if all(record.kind == "ambient" and not record.inputs.shape[0] for record in recording.records):
        from lab.diagnosis.spectral.diagnose import diagnose_spectra

        if baseline is not None:
            baseline = baseline.select(outputs=[channel.name for channel in recording.outputs])
        seen = diagnose_spectra(
            recording, rig, baseline=baseline, widths=widths, effects=effects, progress=progress
        )
        return replace(seen, unlearnable=(*left_out, *seen.unlearnable))
    before, whole = Work(progress).parts(0.0 if baseline is None else COSTS[0], sum(COSTS))
    calibrating, searching, accepting, concluding = whole.parts(*COSTS)
    nominal = _connected(rig, recording)
    rig, misfit, known = _begun(recording, nominal, baseline, widths or {}, before)
    calibration = calibrate(misfit, rig, calibrating.called("calibrating"))
    found = calibration.fit
    state = State(calibration, found, (), found, (held_out_error(calibration.misfit, found),))
    first: list[Candidate] = []
    refused: Candidate | None = None
    fine: State | None = None
    as_given: Callable[[], list[Array]] | None = None
    left = _left(state)
    if not left.white:
        state = bent(state, recording, rig)
        left = _left(state)
    while len(state.accepted) < MOST_FINDINGS:
        if state.accepted:
            searching, accepting, concluding = Work(progress).parts(*COSTS[1:])
        searching = searching.called(f"searching for a {FURTHER.get(len(state.accepted), 'first')} cause")
        candidates, threshold = search(state.calibration, state.fit, effects, searching)
        if candidates:
            better = settled(state.misfit, state.fit, candidates[0].fit)
            if better.objective < state.fit.objective - UNSETTLED:
                state, fine = with_better(state, better, rig), None
                candidates, threshold = search(state.calibration, state.fit, effects)
        candidates = _credible(candidates, threshold, state, known)
        first = first or candidates
        if not candidates or candidates[0].gain < threshold:
            break
        if candidates[0].cause not in effects:
            refused = candidates[0]
            break
        accepting.called("fitting what was found")
        # Fits of one candidate are the work of this process alone.
        as_given = as_given or nominal_ahead(replace(state, fit=candidates[0].fit), recording, nominal)
        further = with_cause(state, candidates[0], rig)
        fitted = finely(further)
        covered = known is not None and known.covers(fitted.misfit, fitted.fit)
        after = _left(fitted)
        if not after.white:
            further = bent(with_better_names(tried_again(further), effects), recording, rig)
            fitted = finely(further)
            after = _left(fitted)
        if state.accepted and not covered and patches(left, after):
            break
        state, left, fine = further, after, fitted
        if (left.passed or covered) and not any(c.gain > threshold for c in _still_wrong(state)):
            break
    kept = without_idle(state)
    state = fine if fine is not None and kept is state else finely(kept)
    left = _left(state)
    told = concluding.called("simulating what was found")
    as_given = as_given or nominal_ahead(state, recording, nominal)
    diagnosis = conclude(state, recording, nominal, rig, first, left, known, refused, as_given, told)
    return replace(diagnosis, unlearnable=(*left_out, *diagnosis.unlearnable))


def _left(state: State) -> Whiteness:
    """What the fit so far leaves."""
    residual, misfit = state.fit.residual, state.misfit
    missing = np.isnan(misfit.measured)
    return whiteness(residual, misfit.driven, misfit.measured - residual, missing=missing)


def _begun(
    recording: Recording, rig: Rig, baseline: Recording | None, widths: Mapping[str, float], work: Work
) -> tuple[Rig, Misfit, Baseline | None]:
    """What is to be calibrated, the rig or what a baseline makes of it; its misfit; and what the baseline taught."""
    model, known = twin(rig), None
    parameters = parameters_of(model, widths)
    if np.any(parameters.widths <= 0):
        raise LabError(
            "a width of zero is taken with frequency responses only; give a small width, such as 0.0001"
        )
    if baseline is not None:
        work = work.called("calibrating on the baseline")
        known_state = _like(baseline, recording)
        base = Misfit.of(known_state, model, parameters, share=1.0)
        base = with_starts(base, free_decays(known_state))
        known = Baseline.of(calibrate(base, rig, work))
        # What the baseline taught becomes the model, and what it left open the prior.
        rig = calibrated_rig(base, known.fit.theta, rig)
        model, parameters = twin(rig), _tightened(parameters, known.fit)
    misfit = with_starts(Misfit.of(recording, model, parameters), free_decays(recording))
    substeps = LAW_SUBSTEPS if model.plant.laws else misfit.substeps
    return rig, replace(misfit, colour=known.colour if known else 1.0, substeps=substeps), known


def _connected(rig: Rig, recording: Recording) -> Rig:
    """The rig with the recording's channels."""
    blind = [i for i, r in enumerate(recording.records) if not r.inputs.shape[0] and r.kind != "free_decay"]
    if blind:
        raise LabError(
            f"record {blind[0]} has no measured input and is {recording.records[blind[0]].kind!r}; expected measured forces or "
            "a free decay"
        )
    return rig.connected(
        inputs=[channel.name for channel in recording.inputs],
        outputs=[channel.name for channel in recording.outputs],
    )


def _like(baseline: Recording, recording: Recording) -> Recording:
    """The baseline with the channels of the recording."""
    if baseline.sample_rate != recording.sample_rate:
        raise LabError(
            f"the baseline was sampled at {baseline.sample_rate} Hz and the recording at {recording.sample_rate} Hz; expected "
            "equal rates"
        )
    return baseline.select(
        inputs=[channel.name for channel in recording.inputs],
        outputs=[channel.name for channel in recording.outputs],
    )


def _tightened(parameters: Parameters, known: Fit) -> Parameters:
    """The parameters with prior widths shrunk to what a baseline left open, never below a tenth of a percent.

    Gains stay what the baseline made of them: what drives the structure is the same, and only ratios to its scale are sought.
    """
    n, total = parameters.n_structural, known.theta.size
    precision = known.information[:total, :total] + known.precision
    others = [i for i in range(total) if not n <= i < parameters.n_factors]
    spread = np.sqrt(np.diag(np.linalg.pinv(precision[np.ix_(others, others)], rcond=1e-14, hermitian=True)))
    widths = np.maximum(parameters.widths[:n] * np.minimum(spread[:n], 1.0), 1e-3)
    return replace(parameters, names=parameters.names[:n], widths=widths, precision=np.eye(n), inputs=())


def _credible(
    candidates: list[Candidate], threshold: float, state: State, known: Baseline | None
) -> list[Candidate]:
    """The candidates from the first on that may be named.

    None is under which the structure would move far more than it did, on data kept aside; nor what the baseline shows as well,
    since what was there before has not changed.
    """
    for i, candidate in enumerate(candidates):
        if candidate.gain < threshold or candidate.direction is not None:
            return candidates[i:]
        error = held_out_error(state.misfit, candidate.fit)
        samples = candidate.fit.residual.shape[1] / state.misfit.colour
        runs_away = error > RUNS_AWAY * max(1.0, state.held_out[-1])
        if not (runs_away or (known and known.shows(candidate.fit.causes[-1], candidate.gain, samples))):
            return candidates[i:]
    return []


def _still_wrong(state: State) -> list[Candidate]:
    """Parameters of the model that are out of tolerance with the causes so far in it."""
    return wrong_parameters(state.misfit, state.fit, minus_two_log_evidence(state.fit), OWN_CHANGES)
