"""Replay: a rig driven by the inputs of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.recording import Array, Recording
from lab.errors import LabError
from lab.excitation import BLOCK, Blocks, Excitation, Load, Sampling
from lab.rig import Rig
from lab.simulate import simulate


@dataclass(frozen=True, eq=False)
class Replay(Excitation):
    """Recorded inputs, (n_inputs, n_samples), applied once more, from rest or from a motion.

    Attributes:
        inputs: forces.
        start: displacement and velocity of every degree of freedom; rest when None.
    """

    kind = "other"
    inputs: Array
    start: tuple[Array, Array] | None = None

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        """One load: the recorded inputs."""

        def blocks() -> Blocks:
            for first in range(0, sampling.n_samples, BLOCK):
                yield self.inputs[:, first : first + BLOCK], None

        rest = np.zeros(len(rig.dofs))
        return [Load(self.kind, sampling.n_samples, blocks, *(self.start or (rest, rest)))]


def replay(
    rig: Rig,
    recording: Recording,
    *,
    accuracy: float,
    starts: Sequence[tuple[Array, Array] | None] | None = None,
) -> list[Array]:
    """Outputs of a rig under the inputs of each record, (n_outputs, n_samples) each, by MuJoCo.

    Args:
        rig: with the channels of the recording connected.
        recording: whose inputs drive it.
        accuracy: relative error that is small enough; where forces have kinks, what can be reached is taken.
        starts: displacement and velocity at the start of each record; all begin at rest when None.
    """
    outputs = []
    begins = starts or [None] * len(recording.records)
    for record, start in zip(recording.records, begins, strict=True):
        inputs = np.asarray(record.inputs[:, :])
        if not inputs.shape[0]:
            inputs = np.zeros((len(rig.inputs), record.n_samples))
        rate, duration = recording.sample_rate, record.n_samples / recording.sample_rate
        for allowed in (accuracy, 10 * accuracy, 100 * accuracy, 0.9):
            try:
                simulated = simulate(
                    rig, Replay(inputs, start), sample_rate=rate, duration=duration, accuracy=allowed
                )
            except LabError:
                continue
            outputs.append(np.asarray(simulated.records[0].outputs[:, :]))
            break
        else:
            raise LabError(
                f"the motion of {rig.name!r} under the recorded inputs cannot be simulated; check the model"
            )
    return outputs
