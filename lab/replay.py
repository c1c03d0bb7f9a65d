"""Replay: a rig driven by the inputs of a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.recording import Array, Recording
from lab.errors import LabError
from lab.excitation import BLOCK, Blocks, Excitation, Load, Sampling
from lab.rig import Rig
from lab.simulate import simulate


@dataclass(frozen=True, eq=False)
class Replay(Excitation):
    """Recorded inputs, (n_inputs, n_samples), applied once more."""

    kind = "other"
    inputs: Array

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        """One load: the recorded inputs from rest."""

        def blocks() -> Blocks:
            for first in range(0, sampling.n_samples, BLOCK):
                yield self.inputs[:, first : first + BLOCK], None

        rest = np.zeros(len(rig.dofs))
        return [Load(self.kind, sampling.n_samples, blocks, rest, rest)]


def replay(rig: Rig, recording: Recording, *, accuracy: float) -> list[Array]:
    """Outputs of a rig under the inputs of each record, (n_outputs, n_samples) each, by MuJoCo.

    Args:
        rig: with the channels of the recording connected.
        recording: whose inputs drive it.
        accuracy: relative error that is small enough; where forces have kinks, what can be reached is taken.
    """
    outputs = []
    for record in recording.records:
        inputs = np.asarray(record.inputs[:, :])
        rate, duration = recording.sample_rate, record.n_samples / recording.sample_rate
        for allowed in (accuracy, 10 * accuracy, 100 * accuracy, 0.9):
            try:
                simulated = simulate(
                    rig, Replay(inputs), sample_rate=rate, duration=duration, accuracy=allowed
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
