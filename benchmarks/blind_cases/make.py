"""Data of a case: clean responses by MuJoCo or by the cases' own integrator, then noise, then single precision."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.blind_cases.excite import Run
from benchmarks.blind_cases.structure import Array, Structure
from benchmarks.blind_cases.truth import Hidden
from identification.recording import Record, Recording
from lab.errors import LabError
from lab.excitation import FreeDecay
from lab.replay import Replay
from lab.rig import Rig
from lab.simulate import simulate


def connected(structure: Structure) -> Rig:
    """The lab's rig of a structure with the channels of the case."""
    inputs, outputs = ([port.name for port in side] for side in (structure.inputs, structure.outputs))
    return Rig.from_xml(structure.xml).connected(inputs=inputs, outputs=outputs)


def by_mujoco(
    structure: Structure, runs: Sequence[Run], dt: float, hidden: Sequence[Hidden], accuracy: float
) -> list[Array]:
    """Clean outputs of every record, (n_outputs, n_samples) each, of the structure with causes hidden in it."""
    rig = connected(structure)
    for each in hidden:
        rig = each.effect().apply(rig)
    return [_simulated(rig, structure, run, dt, accuracy) for run in runs]


def _simulated(rig: Rig, structure: Structure, run: Run, dt: float, accuracy: float) -> Array:
    load = Replay(run.inputs)
    if run.release is not None:
        load = FreeDecay(dict(zip(structure.dofs, run.release.tolist(), strict=True)))  # type: ignore[assignment]
    duration = run.inputs.shape[1] * dt
    # A force with kinks is not followed to the last digit: a few times coarser is still below the noise.
    for allowed in (accuracy, 3 * accuracy):
        try:
            made = simulate(rig, load, sample_rate=1 / dt, duration=duration, accuracy=allowed)
            return np.asarray(made.records[0].outputs[:, :])
        except LabError as error:
            reason = error
    raise reason


def recorded(
    structure: Structure,
    runs: Sequence[Run],
    clean: Sequence[Array],
    dt: float,
    *,
    noise: float,
    rng: np.random.Generator,
) -> tuple[Recording, Array]:
    """The recording with white noise of `noise` times the RMS of every output, and the noise's RMS (n_outputs,)."""
    level = noise * np.sqrt(np.mean(np.concatenate(clean, axis=1) ** 2, axis=1))
    records = []
    for run, y in zip(runs, clean, strict=True):
        noisy = y + level[:, None] * rng.standard_normal(y.shape)
        u = run.inputs if run.release is None else np.zeros((0, y.shape[1]))
        records.append(Record(run.kind, u, noisy.astype(np.float32).astype(np.float64)))
    rig = connected(structure)
    inputs = rig.inputs if all(run.release is None for run in runs) else ()
    return Recording(tuple(records), inputs, rig.outputs, 1 / dt), level
