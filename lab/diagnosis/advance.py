"""Advance: from one state of a diagnosis to the next, by a further cause, a better fit or a better name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from lab.diagnosis.calibrate import Calibration, survey_of
from lab.diagnosis.candidate import Candidate
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.fit import Fit, fit, resumed
from lab.diagnosis.gain import held_out_error
from lab.diagnosis.revise import renamed, restarted
from lab.diagnosis.state import State
from lab.effects.effect import Effect
from lab.rig import Rig

LAW_SUBSTEPS = 12
"""Substeps where the model has a law or one was found, so that its numerics are not taken for another cause."""
FINE_SUBSTEPS = 24
"""Substeps of the last fits, where the numerics must not be mistaken for physics."""


def with_cause(state: State, candidate: Candidate, rig: Rig) -> State:
    """The state with one more cause accepted, everything refitted together."""
    misfit, found = state.misfit, candidate.fit
    if candidate.direction is not None:
        misfit = replace(misfit, parameters=misfit.parameters.lifted(candidate.direction))
    refit = resumed(misfit, found, iterations=15, tolerance=0.1)
    misfit = replace(misfit, survey=survey_of(misfit, rig, refit.theta, refit.residual))
    if misfit.plant(refit.theta, refit.causes).laws:
        misfit = replace(misfit, substeps=LAW_SUBSTEPS)
    calibration = Calibration(misfit, refit, refit, 0.0)
    held_out = (*state.held_out, held_out_error(misfit, refit))
    return State(calibration, refit, (*state.accepted, candidate), state.origin, held_out)


def with_better(state: State, better: Fit, rig: Rig) -> State:
    """The state with a better fit of the causes so far."""
    misfit = state.misfit
    misfit = replace(misfit, survey=survey_of(misfit, rig, better.theta, better.residual))
    calibration = Calibration(misfit, better, better, 0.0)
    held_out = (*state.held_out[:-1], held_out_error(misfit, better))
    origin = state.origin if state.accepted else better
    return State(calibration, better, state.accepted, origin, held_out)


def tried_again(state: State) -> State:
    """The state with a better fit, if there is one from the model's own parameters."""
    return _with_fit(state, restarted(state.misfit, state.fit), state.accepted)


def with_better_names(state: State, effects: Mapping[str, type[Effect]]) -> State:
    """The state with causes that were named while others were missing exchanged for better ones at their places."""
    if len(state.accepted) < 2:
        return state
    accepted, found = list(state.accepted), state.fit
    positions = [i for i, candidate in enumerate(accepted) if candidate.direction is None]
    for number, position in enumerate(positions):
        found = renamed(state.misfit, found, number, effects)
        cause = found.causes[number]
        accepted[position] = replace(accepted[position], cause=cause.kind.cause, location=cause.location)
    return _with_fit(state, found, tuple(accepted))


def _with_fit(state: State, found: Fit, accepted: tuple[Candidate, ...]) -> State:
    """The state with another fit of as many causes."""
    calibration = replace(state.calibration, fit=found, guided=found)
    held_out = (*state.held_out[:-1], held_out_error(state.misfit, found))
    return State(calibration, found, accepted, state.origin, held_out)


def finely(state: State) -> State:
    """The state refitted with substeps so fine that numerics are not mistaken for physics."""
    if not any(state.misfit.plant(state.fit.theta, state.fit.causes).laws):
        return state
    misfit = replace(state.misfit, substeps=FINE_SUBSTEPS)
    refit = resumed(misfit, state.fit, iterations=3)
    return replace(state, fit=refit, calibration=replace(state.calibration, misfit=misfit))


def without_idle(state: State) -> State:
    """The state without causes whose evidence is gone now that others were found."""
    if len(state.accepted) < 2:
        return state
    with_all = minus_two_log_evidence(state.fit)
    for number, candidate in enumerate(state.accepted):
        if candidate.direction is not None:
            continue
        position = sum(c.direction is None for c in state.accepted[:number])
        causes = tuple(c for i, c in enumerate(state.fit.causes) if i != position)
        trial = fit(
            state.misfit,
            state.fit.theta,
            causes,
            observer=state.fit.observer,
            iterations=10,
            refresh=1,
            tolerance=0.1,
        )
        if minus_two_log_evidence(trial) <= with_all:
            kept = (*state.accepted[:number], *state.accepted[number + 1 :])
            errors = (*state.held_out[: number + 1], *state.held_out[number + 2 :])
            return without_idle(replace(state, fit=trial, accepted=kept, held_out=errors))
    return state
