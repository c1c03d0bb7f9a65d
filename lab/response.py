"""Response: a batch of structures stepped under commands, with actuators before and sensors behind that see substeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.recording import DERIVATIVE, Array
from lab.rig import Rig
from lab.stages import Process
from lab.stepping import Stepper


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of a batch of records, sampled: commands, applied forces, readings and positions."""

    commands: Array  # (n_batch, n_inputs, m)
    applied: Array  # (n_batch, n_inputs, m)
    outputs: Array  # (n_batch, n_outputs, m)
    positions: Array  # (n_batch, n_dofs, m)


class Response:
    """A stepper with the actuators before it and, where they must see substeps, the sensors behind it."""

    def __init__(self, rig: Rig, stepper: Stepper, dt: float) -> None:
        self.rig, self.stepper = rig, stepper
        h = dt / stepper.substeps
        chain, batch = rig.chain, range(stepper.n_batch)
        self.controls = [rig.control_of(channel.name) for channel in rig.inputs]
        self.rows = [rig.row_of(channel.name) for channel in rig.outputs]
        stages = [chain.for_channel("actuators", channel.name) for channel in rig.inputs]
        rng = np.random.default_rng(0)
        self.sampled = [
            [[s.start(dt, rng, 0.0) for s in row if s.at_samples] for row in stages] for _ in batch
        ]
        self.actuators = [
            [[s.start_held(h) for s in row if not s.at_samples] for row in stages] for _ in batch
        ]
        self.sensors = [fresh_sensors(rig, h, between=True) for _ in batch] if chain.needs_substeps else None
        self.last_forces: Array | None = None

    def respond(self, commands: Array, forces: Array | None) -> Part:
        """The batch's response to commands (n_batch, n_inputs, m) and forces (n_batch, n_dofs, m), sampled."""
        size, parts = self.stepper.samples_per_chunk, []
        for a in range(0, commands.shape[2], size):
            parts.append(
                self._chunk(
                    commands[..., a : a + size], None if forces is None else forces[..., a : a + size]
                )
            )
        fields = ("applied", "outputs", "positions")
        joined = {name: np.concatenate([getattr(part, name) for part in parts], axis=2) for name in fields}
        return Part(commands, **joined)

    def _chunk(self, commands: Array, forces: Array | None) -> Part:
        sub = self.stepper.substeps
        sampled = np.stack([through(rows, x) for rows, x in zip(self.sampled, commands, strict=True)])
        # (n_batch, n_inputs, 3, n_substeps)
        held = np.repeat(np.repeat(sampled, sub, axis=2)[:, :, None], 3, axis=2)
        acting = np.stack([through(rows, x) for rows, x in zip(self.actuators, held, strict=True)])
        controls = np.zeros((acting.shape[0], self.rig.model.nu, *acting.shape[2:]))
        controls[:, self.controls] = acting
        applied = acting[:, :, 1]
        pushes = None if forces is None else np.repeat(forces, sub, axis=2)
        sensordata, positions = self.stepper.advance(controls[:, :, 1], pushes)
        readings = sensordata[:, self.rows]
        if self.sensors is not None:
            pairs = self._both_sides(readings, controls, pushes)
            readings = np.stack([through(rows, y)[:, 2] for rows, y in zip(self.sensors, pairs, strict=True)])
        measured = commands
        if self.rig.chain.force_measured:
            measured = applied.reshape(*commands.shape, sub).mean(axis=3)
        return Part(commands, measured, readings[..., ::sub], positions[..., ::sub])

    def _both_sides(self, readings: Array, controls: Array, pushes: Array | None) -> Array:
        """Readings on both sides of each instant and at it, shape (n_batch, n_outputs, 3, n_substeps).

        MuJoCo reads with the mean force of the substep that starts; another force changes the acceleration through the
        feedthrough.
        """
        forces = controls
        if pushes is not None:
            forces = np.concatenate([controls, np.repeat(pushes[:, :, None], 3, axis=2)], axis=1)
        start, mean = forces[:, :, 0], forces[:, :, 1]
        first = self.last_forces is None
        last = np.zeros((*mean.shape[:2], 1)) if self.last_forces is None else self.last_forces
        previous = np.concatenate([last, mean[..., :-1]], axis=2)
        self.last_forces = mean[..., -1:]
        D = self.rig.feedthrough[self.rows]
        before, now = readings.copy(), readings.copy()
        # One force after the other: a matrix product would round differently for chunks of another length.
        for j in np.flatnonzero(np.any(D[:, : forces.shape[1]] != 0, axis=0)):
            before += D[:, j, None] * (previous - mean)[:, j, None]
            now += D[:, j, None] * (start - mean)[:, j, None]
        if first:
            # Before a release the structure was held still where it starts.
            before[:, [DERIVATIVE.get(c.quantity, 2) > 0 for c in self.rig.outputs], 0] = 0.0
        return np.stack([before, readings, now], axis=2)


def fresh_sensors(rig: Rig, dt: float, *, between: bool) -> list[list[Process]]:
    """Fresh sensor stages for every output of one record: those that must see substeps, or those behind the last of them."""
    rng, rows = np.random.default_rng(0), []
    for channel in rig.outputs:
        stages = rig.chain.for_channel("sensors", channel.name)
        split = max((i + 1 for i, stage in enumerate(stages) if stage.needs_substeps), default=0)
        rows.append([s.start(dt, rng, 0.0) for s in (stages[:split] if between else stages[split:])])
    return rows


def sensed(processes: Sequence[Sequence[Process]], outputs: Array) -> Array:
    """Samples of one record after sensors that do not look between them."""
    return through(processes, np.stack([outputs, outputs, outputs], axis=1))[:, 2]


def through(processes: Sequence[Sequence[Process]], signals: Array) -> Array:
    """Every row through its own processes."""
    if not any(processes):
        return signals
    rows = []
    for row, chain in zip(signals, processes, strict=True):
        for process in chain:
            row = process(row)
        rows.append(row)
    return np.stack(rows) if rows else signals
