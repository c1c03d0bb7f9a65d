"""What the catalogue does not have: laws and instruments that only the cases' own integrator knows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.blind_cases.excite import Run
from benchmarks.blind_cases.motion import DENSE, Law, read, respond
from benchmarks.blind_cases.structure import Array, Structure
from benchmarks.blind_cases.truth import Hidden, Scale

Change = Callable[[Array], Array]
Draw = Callable[[Scale, np.random.Generator, float], "Strange"]


@dataclass(frozen=True, eq=False)
class Strange:
    """One thing that the catalogue does not have.

    Attributes:
        hidden: its name.
        laws: further forces.
        sense: what becomes of the readings at every dense instant, (n_outputs, n_samples * DENSE).
        feel: what becomes of the recorded forces, (n_inputs, n_samples).
        clock: true over nominal length of the samples, from their number; none when None.
    """

    hidden: Hidden
    laws: Sequence[Law] = ()
    sense: Change | None = None
    feel: Change | None = None
    clock: Callable[[int], Array] | None = None


def by_own_integrator(structure: Structure, runs: Sequence[Run], dt: float, strange: Strange) -> list[Array]:
    """Clean outputs of every record, (n_outputs, n_samples) each."""
    outputs = []
    for run in runs:
        u = run.inputs if strange.feel is None else strange.feel(run.inputs)
        clock = None if strange.clock is None else strange.clock(u.shape[1])
        y = read(structure, respond(structure, u, dt, strange.laws, clock=clock))
        outputs.append((y if strange.sense is None else strange.sense(y))[:, ::DENSE])
    return outputs


def on_row(row: int, change: Change) -> Change:
    """The change of one channel, the others as they are."""

    def changed(y: Array) -> Array:
        y = y.copy()
        y[row] = change(y[row])
        return y

    return changed


def sharpness(scale: Scale, dof: int, force: float) -> float:
    """Velocity over which dry friction turns over [m/s]: a thousandth of the RMS, or what the integrator can follow."""
    mass = scale.structure.matrices[0][dof, dof]
    step = scale.dt / (DENSE * 8)
    return max(1e-3 * float(np.std(scale.motion[1, dof])), 1.2 * force * step / mass)
