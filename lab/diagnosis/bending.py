"""Bending: what a structure does beyond its tangent, such as bars that turn as they move: MuJoCo has it, the fast twin not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.recording import Recording
from lab.diagnosis.conclude import accuracy_below, extended_rig, floor_of
from lab.diagnosis.fit import resumed
from lab.diagnosis.gain import held_out_error, predicted, simulated
from lab.diagnosis.starts import motions_of, starts_of
from lab.diagnosis.state import State
from lab.errors import LabError
from lab.rig import Rig

SHOWN = 30.0
"""-2 log posterior by which a fit must fall for the bending to be taken for real."""


def bent(state: State, recording: Recording, rig: Rig) -> State:
    """The state with what its model does beyond its tangent added to the twin, where the data show it.

    Both the twin and MuJoCo are driven by the measured inputs. By what they differ changes little when parameters do, so that
    fits go on with the twin.

    Args:
        state: with the causes so far.
        recording: measured.
        rig: what was calibrated.
    """
    if rig.straight:
        return state
    misfit, found = state.misfit, state.fit
    model = extended_rig(state, rig)
    accuracy = accuracy_below(floor_of(state))
    try:
        motions = motions_of(model, rig.dofs, starts_of(misfit, found.theta))
        outputs = simulated(recording, (model, motions), accuracy=accuracy, substeps=misfit.substeps)
    except LabError:
        return state
    tangent = predicted(replace(misfit, bend=()), found)
    missing = [np.isnan(y) for _, y in misfit.records]
    bend = tuple(
        np.where(gap, 0.0, real - own) for real, own, gap in zip(outputs, tangent, missing, strict=True)
    )
    if not all(np.all(np.isfinite(part)) for part in bend):
        return state
    misfit = replace(misfit, bend=bend)
    fit = resumed(misfit, found, iterations=15, tolerance=0.1)
    if not fit.objective < found.objective - SHOWN:
        return state
    guided = fit if state.accepted else resumed(misfit, state.calibration.guided, iterations=5)
    calibration = replace(state.calibration, misfit=misfit, fit=fit, guided=guided)
    # What the causes gain is counted from a model that bends, too.
    first = (held_out_error(misfit, state.origin),) if state.accepted else ()
    held_out = (*first, *state.held_out[1:-1], held_out_error(misfit, fit))
    return replace(
        state,
        calibration=calibration,
        fit=fit,
        held_out=held_out,
        origin=state.origin if state.accepted else fit,
    )
