"""Bench: a rig with its loads on, which responds record by record, and what instruments make of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.recording import Array
from lab.errors import LabError
from lab.excitation import Excitation
from lab.loads import Load, Sampling
from lab.response import Part, Response, fresh_sensors, sensed, through
from lab.rig import Rig
from lab.stages import Process
from lab.stepping import Plan, Stepper

DRIVE, NOISE, DISTURBANCE = 0, 1, 2
"""Separate streams of randomness: what drives the structure, and what disturbs the signals."""

Progress = Callable[[int], None]


@dataclass(frozen=True, eq=False)
class Bench:
    """A rig with its loads on, ready to run.

    Attributes:
        rig: structure and measurement chain.
        loads: of all records.
        sample_rate: [Hz].
        plan: substeps.
        accuracy: largest error that was asked for; zero where none is measured.
        seed: of everything random.
    """

    rig: Rig
    loads: tuple[Load, ...]
    sample_rate: float
    plan: Plan
    accuracy: float
    seed: int

    @classmethod
    def loaded(
        cls, rig: Rig, excitation: Excitation, sample_rate: float, duration: float, n_runs: int, seed: int
    ) -> Bench:
        """The bench with its loads on, the substeps still open."""
        for name, value in (("sample_rate", sample_rate), ("duration", duration)):
            if not (np.isfinite(value) and value > 0):
                raise LabError(f"{name} is {value}; expected a positive number")
        for name, count, least in (("n_runs", n_runs, 1), ("seed", seed, 0)):
            if not (isinstance(count, int | np.integer) and count >= least):
                raise LabError(f"{name} is {count}; expected a whole number of at least {least}")
        n_samples = round(duration * sample_rate)
        if n_samples < 1 or not rig.outputs:
            raise LabError(
                f"the test has {n_samples} samples and {len(rig.outputs)} output channels; expected at least one of each"
            )
        rng = np.random.default_rng([seed, DRIVE])
        sampling = Sampling(sample_rate, n_samples)
        every = [load for _ in range(n_runs) for load in excitation.loads(rig, sampling, rng)]
        loads = tuple(replace(load, number=number) for number, load in enumerate(every))
        return cls(rig, loads, sample_rate, Plan(1), 0.0, seed)

    @property
    def attributes(self) -> dict[str, str | float]:
        """Facts about the simulation that travel with the recording."""
        return {
            "simulation_error": self.plan.error,
            "simulation_accuracy": self.accuracy,
            "simulation_substeps": float(self.plan.substeps),
        }

    def responses(
        self, progress: Progress | None, *, one_by_one: bool = False
    ) -> Iterator[tuple[Load, Iterator[tuple[Array, Array]]]]:
        """Each load with its clean samples, block by block: measured inputs and outputs."""
        if one_by_one:
            for load_ in self.loads:
                yield load_, ((part.applied[0], part.outputs[0]) for part in self.batch([load_], progress))
            return
        parts = [(part.applied, part.outputs) for part in self.batch(self.loads, progress)]
        for number, load_ in enumerate(self.loads):
            yield load_, ((applied[number], outputs[number]) for applied, outputs in parts)

    def batch(self, loads: Sequence[Load], progress: Progress | None) -> Iterator[Part]:
        """Records of equal length side by side, in stretches of at most `BLOCK` samples."""
        for (part,) in self.combined(loads, (self.plan,)):
            yield part
            if progress is not None:
                progress(part.outputs.shape[2] * len(loads))

    def combined(self, loads: Sequence[Load], plans: Sequence[Plan]) -> Iterator[list[Part]]:
        """What each of several plans makes of the loads; substeps that plans have in common are run once."""
        counts = sorted({count for plan in plans for count in plan.runs}, reverse=True)
        sensors = [
            [fresh_sensors(self.rig, 1 / self.sample_rate, between=False) for _ in loads] for _ in plans
        ]
        for stretch in self._runs(loads, counts):
            done = []
            for plan, rows in zip(plans, sensors, strict=True):
                parts = [stretch[counts.index(count)] for count in plan.runs]
                outputs = plan.combined([part.outputs for part in parts])
                positions = plan.combined([part.positions for part in parts])
                outputs = np.stack([sensed(row, y) for row, y in zip(rows, outputs, strict=True)])
                done.append(replace(parts[0], outputs=outputs, positions=positions))
            yield done

    def _runs(self, loads: Sequence[Load], counts: Sequence[int]) -> Iterator[list[Part]]:
        """The response with each number of substeps."""
        start = (np.stack([load.position for load in loads]), np.stack([load.velocity for load in loads]))
        dt = 1 / self.sample_rate
        duration = max(load.n_record for load in loads) * dt
        disturb = [self._disturbances(load) for load in loads]
        runs = [Response(self.rig, Stepper(self.rig, dt, count, *start, duration), dt) for count in counts]
        blocks = [load.blocks() for load in loads]
        done = 0
        while done < loads[0].n_samples:
            items = [next(block) for block in blocks]
            n = min(items[0][0].shape[1], loads[0].n_samples - done)
            commands = np.stack([item[0][:, :n] for item in items])
            forces = None if items[0][1] is None else np.stack([item[1][:, :n] for item in items])  # type: ignore[index]
            if self.rig.chain.disturbances:
                pushes = np.stack([through(rows, np.zeros((len(rows), n))) for rows in disturb])
                forces = pushes if forces is None else forces + pushes
            yield [run.respond(commands, forces) for run in runs]
            done += n

    def _disturbances(self, load: Load) -> list[list[Process]]:
        """Fresh stages of the unmeasured force on every degree of freedom during one load."""
        dt, chain = 1 / self.sample_rate, self.rig.chain
        found = []
        for row, dof in enumerate(self.rig.dofs):
            stages = chain.for_channel("disturbances", dof)
            rngs = [
                np.random.default_rng([self.seed, DISTURBANCE, load.number, row, i])
                for i in range(len(stages))
            ]
            found.append([stage.start(dt, rng, 0.0) for stage, rng in zip(stages, rngs, strict=True)])
        return found

    def digitizer(
        self, number: int, rms_inputs: Array, rms_outputs: Array
    ) -> Callable[[Array, Array], tuple[Array, Array]]:
        """What force sensors and acquisition make of the samples of record `number`, block by block."""
        dt, chain = 1 / self.sample_rate, self.rig.chain
        order = swapped(self.rig)
        rms_outputs = rms_outputs[order]
        sides = (
            ("force_sensors", self.rig.inputs, rms_inputs),
            ("acquisition", self.rig.outputs, rms_outputs),
        )
        processes = []
        for side, (place, channels, rms) in enumerate(sides):
            rows = []
            for channel, size in zip(channels, rms, strict=True):
                stages = chain.for_channel(place, channel.name)
                # By name, so that a channel's noise does not depend on which others are connected.
                rngs = [
                    np.random.default_rng([self.seed, NOISE, number, side, i, *channel.name.encode()])
                    for i in range(len(stages))
                ]
                rows.append([s.start(dt, rng, float(size)) for s, rng in zip(stages, rngs, strict=True)])
            processes.append(rows)

        def digitize(inputs: Array, outputs: Array) -> tuple[Array, Array]:
            return through(processes[0], inputs), through(processes[1], outputs[order])

        return digitize


def swapped(rig: Rig) -> list[int]:
    """Which output each recorded channel really carries."""
    names = [channel.name for channel in rig.outputs]
    order = list(range(len(names)))
    for a, b in rig.chain.swaps:
        if a in names and b in names:
            i, j = names.index(a), names.index(b)
            order[i], order[j] = order[j], order[i]
    return order
