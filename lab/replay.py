"""Replay: a rig driven by the inputs of a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import numpy as np

from identification.recording import Array, Recording
from lab.errors import LabError
from lab.excitation import Excitation
from lab.loads import BLOCK, Blocks, Load, Sampling
from lab.rig import Rig
from lab.simulate import simulate
from lab.stepping import first_guess, highest_frequency

MOST_SUBSTEPS = 256
"""Where doubling the substeps ends, converged or not."""
DRY_SUBSTEPS = 64
"""Of dry friction, where the error falls with the root of the substep only: that of MuJoCo then errs by one percent of
accelerations."""

Respond = Callable[..., Recording]


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
    expected: Sequence[Array] | None = None,
) -> list[Array]:
    """Outputs of a rig under the inputs of each record, (n_outputs, n_samples) each, by MuJoCo.

    Args:
        rig: with the channels of the recording connected.
        recording: whose inputs drive it.
        accuracy: relative error that is small enough, in the root mean square where the rig is not linear or outputs are
            expected; under dry friction, what can be reached is taken.
        starts: displacement and velocity at the start of each record; all begin at rest when None.
        expected: outputs by other means, (n_outputs, n_samples) each: what agrees with them needs no finer substeps.
    """
    outputs = []
    unknown = [None] * len(recording.records)
    begins, others = starts or unknown, expected or unknown
    for record, start, other in zip(recording.records, begins, others, strict=True):
        inputs = np.asarray(record.inputs[:, :])
        if not inputs.shape[0]:
            inputs = np.zeros((len(rig.inputs), record.n_samples))
        rate, duration = recording.sample_rate, record.n_samples / recording.sample_rate
        respond = partial(simulate, rig, Replay(inputs, start), sample_rate=rate, duration=duration)
        if rig.linear:
            outputs.append(_refined(rig, respond, 1 / rate, duration, accuracy, other))
        else:
            outputs.append(_doubled(rig, respond, 1 / rate, accuracy, other))
    return outputs


def _refined(
    rig: Rig, respond: Respond, dt: float, duration: float, accuracy: float, expected: Array | None
) -> Array:
    """Outputs that are what was expected, or as accurate as asked for, or nearly so."""
    if expected is not None:
        guess = first_guess(rig, dt, accuracy, duration)
        with suppress(LabError):
            coarse = None if guess.cancelled else _outputs(respond(substeps=guess.substeps))
            if coarse is not None and _agree(coarse, expected, accuracy):
                return coarse
    for allowed in (accuracy, 10 * accuracy, 100 * accuracy, 0.9):
        try:
            return _outputs(respond(accuracy=allowed))
        except LabError:
            continue
    raise LabError(
        f"the motion of {rig.name!r} under the recorded inputs cannot be simulated; check the model"
    )


def _doubled(rig: Rig, respond: Respond, dt: float, accuracy: float, expected: Array | None) -> Array:
    """Outputs with substeps doubled until they stay what they are in the root mean square, or are what was expected."""
    if np.any(rig.model.dof_frictionloss) or np.any(rig.model.tendon_frictionloss):
        return _outputs(respond(substeps=DRY_SUBSTEPS))
    substeps = 2 ** int(np.ceil(np.log2(max(highest_frequency(rig) * dt, 4.0))))
    coarse = _outputs(respond(substeps=substeps))
    if expected is not None and _agree(coarse, expected, accuracy):
        return coarse
    while True:
        substeps *= 2
        fine = _outputs(respond(substeps=substeps))
        if _agree(fine, coarse, accuracy) or substeps >= MOST_SUBSTEPS:
            return fine
        coarse = fine


def _agree(outputs: Array, others: Array, accuracy: float) -> bool:
    """Whether outputs differ by no more than a share of their root mean square."""
    # What others expect may have diverged.
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.sqrt(np.mean(outputs**2, axis=1))
        return bool(np.all(np.sqrt(np.mean((outputs - others) ** 2, axis=1)) <= accuracy * size))


def _outputs(recording: Recording) -> Array:
    return np.asarray(recording.records[0].outputs[:, :])
