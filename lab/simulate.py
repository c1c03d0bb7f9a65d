"""Simulate: a rig under a load gives a recording, through MuJoCo and the whole measurement chain."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.recording import Array, Record, Recording
from lab import stepping
from lab.errors import LabError
from lab.excitation import Excitation
from lab.files.recording import RecordingWriter, load
from lab.loads import BLOCK, Load, Sampling
from lab.response import Part, Response, fresh_sensors, sensed, through
from lab.rig import Rig
from lab.stages import Process
from lab.stepping import Plan, Stepper

PILOT_SAMPLES, MOST_PILOT_SAMPLES = 256, 4096
"""Length of the trial runs on which the error is measured, and at most for lightly damped structures."""

FINEST, FINEST_UNASKED = 4096, 256
"""Most substeps per sample, for an accuracy that was asked for and for the default one."""

IDEAL_ACCURACY, PICTURE_ACCURACY = 1e-9, 1e-3
NOISE_SHARE = 1e-3
"""Default error: this share of the smallest noise in the chain, or `IDEAL_ACCURACY` when the chain adds none."""

DRIVE, NOISE, DISTURBANCE = 0, 1, 2
"""Separate streams of randomness: what drives the structure, and what disturbs the signals."""

Progress = Callable[[int], None]


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of every degree of freedom, for pictures.

    Attributes:
        time: shape (n_samples,) [s].
        position: displacement from the operating point, shape (n_dofs, n_samples) [m or rad].
        inputs: commanded inputs, shape (n_inputs, n_samples).
    """

    time: Array
    position: Array
    inputs: Array


def simulate(
    rig: Rig,
    excitation: Excitation,
    *,
    sample_rate: float,
    duration: float,
    n_runs: int = 1,
    seed: int = 0,
    accuracy: float | None = None,
    substeps: int | None = None,
    progress: Progress | None = None,
) -> Recording:
    """The recording that a test bench would deliver.

    Args:
        rig: structure and measurement chain; it starts at rest at its operating point, where instruments are zeroed.
        excitation: how it is driven.
        sample_rate: [Hz].
        duration: of each record [s].
        n_runs: how often the test is repeated, with fresh randomness.
        seed: of everything random; the same seed gives the same recording to the last bit.
        accuracy: largest error of the simulated response relative to the largest value of its channel; when None, a
            thousandth of the smallest noise in the chain, or 1e-9 when it adds none, as far as 256 substeps go.
        substeps: per sample, in place of an accuracy; the error is not measured then.
        progress: called with the number of samples done since the last call.

    Returns:
        Recording with the attribute `simulation_error`, the measured relative error of the response.

    Raises:
        LabError: the accuracy cannot be reached, or the excitation does not fit the rig.
        DivergedError: the motion is no longer finite.
    """
    if substeps is None:
        bench = _Bench.prepare(rig, excitation, sample_rate, duration, n_runs, seed, accuracy)
    else:
        bench = _Bench.loaded(rig, excitation, sample_rate, duration, n_runs, seed)._with(
            stepping.Plan(substeps)
        )
    records = []
    for number, (load_, blocks) in enumerate(bench.responses(progress)):
        parts = list(blocks)
        if rig.chain.whole_record:
            parts = [
                (np.concatenate([a for a, _ in parts], axis=1), np.concatenate([b for _, b in parts], axis=1))
            ]
        digitize = bench.digitizer(number, _rms(part[0] for part in parts), _rms(part[1] for part in parts))
        digitized = [digitize(a, b) for a, b in parts]
        measured = [part[0] for part in digitized] if load_.measured else [np.zeros((0, load_.n_samples))]
        outputs = np.concatenate([part[1] for part in digitized], axis=1)
        records.append(Record(load_.kind, np.concatenate(measured, axis=1), outputs))
    return Recording(
        tuple(records), rig.inputs, rig.outputs, sample_rate, rig.name, "virtual modal lab", bench.attributes
    )


def simulate_to_file(
    path: str | Path,
    rig: Rig,
    excitation: Excitation,
    *,
    sample_rate: float,
    duration: float,
    n_runs: int = 1,
    seed: int = 0,
    accuracy: float | None = None,
    progress: Progress | None = None,
) -> None:
    """Writes the recording of `simulate` block by block, however long it is; the same values to the last bit."""
    bench = _Bench.prepare(rig, excitation, sample_rate, duration, n_runs, seed, accuracy)
    path = Path(path)
    about = (rig.inputs, rig.outputs, sample_rate)
    whole = RecordingWriter(
        path, *about, title=rig.name, source="virtual modal lab", attributes=bench.attributes
    )
    with whole as final, tempfile.TemporaryDirectory(dir=path.parent) as folder:
        for number, (load_, blocks) in enumerate(bench.responses(progress, one_by_one=True)):
            # Noise relative to a record's RMS is known only at the record's end: keep the clean record until then.
            clean = Path(folder) / "clean.h5"
            with RecordingWriter(clean, *about) as writer:
                writer.start(load_.kind)
                for inputs, outputs in blocks:
                    writer.append(inputs, outputs)
            record = load(clean, lazy=True).records[0]
            rms = (_rms(block[side] for block in record.blocks(BLOCK)) for side in (0, 1))
            digitize = bench.digitizer(number, *rms)
            final.start(load_.kind)
            for inputs, outputs in record.blocks(record.n_samples if rig.chain.whole_record else BLOCK):
                inputs, outputs = digitize(inputs, outputs)
                final.append(inputs if load_.measured else np.zeros((0, outputs.shape[1])), outputs)


def motion(
    rig: Rig,
    excitation: Excitation,
    *,
    sample_rate: float,
    duration: float,
    seed: int = 0,
    progress: Progress | None = None,
) -> Motion:
    """Motion of the first record of the same test, accurate enough to look at; its error is not measured."""
    bench = _Bench.loaded(rig, excitation, sample_rate, duration, 1, seed)
    bench = bench._with(stepping.first_guess(rig, 1 / sample_rate, PICTURE_ACCURACY, duration))
    first = bench.loads[0]
    inputs, positions = [], []
    for part in bench.batch([first], progress):
        inputs.append(part.commands[0])
        positions.append(part.positions[0])
    return Motion(
        np.arange(first.n_samples) / sample_rate,
        np.concatenate(positions, axis=1),
        np.concatenate(inputs, axis=1),
    )


@dataclass(frozen=True, eq=False)
class _Bench:
    """One test, ready to run."""

    rig: Rig
    loads: tuple[Load, ...]
    sample_rate: float
    plan: Plan
    accuracy: float
    seed: int

    @classmethod
    def prepare(
        cls,
        rig: Rig,
        excitation: Excitation,
        sample_rate: float,
        duration: float,
        n_runs: int,
        seed: int,
        accuracy: float | None,
    ) -> _Bench:
        if accuracy is not None and not 1e-13 <= accuracy < 1:
            raise LabError(f"accuracy is {accuracy}; expected a relative error from 1e-13 to below 1")
        return cls.loaded(rig, excitation, sample_rate, duration, n_runs, seed)._planned(accuracy)

    @classmethod
    def loaded(
        cls, rig: Rig, excitation: Excitation, sample_rate: float, duration: float, n_runs: int, seed: int
    ) -> _Bench:
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

    def _planned(self, asked: float | None) -> _Bench:
        """The bench with substeps that reach the accuracy, as measured on the start of its first records."""
        dt, duration = 1 / self.sample_rate, self.loads[0].n_samples / self.sample_rate
        pilots, growth = self._pilots()
        accuracy = IDEAL_ACCURACY if asked is None else asked
        if asked is None and self.rig.chain.acquisition:
            coarse = self._with(stepping.first_guess(self.rig, dt, 1e-4, duration))
            outputs = [part.outputs for part in coarse.batch(pilots, None)]
            accuracy = self._default_accuracy(np.concatenate(outputs, axis=2))
        finest = FINEST if asked is not None else FINEST_UNASKED
        best = plan = self._measured(
            stepping.first_guess(self.rig, dt, accuracy / 2, duration), pilots, growth
        )
        in_vain = 0
        # The rest of the record may err by somewhat more than its start: aim at half of what is asked for.
        aim = accuracy / 2
        # Rounding puts a floor under the error: two finer plans that are hardly better have met it.
        while best.error > aim and plan.substeps < finest and in_vain < 2:
            before = plan.error
            plan = self._measured(stepping.finer(self.rig, dt, plan, aim, finest), pilots, growth)
            in_vain = 0 if plan.error < before / 2 else in_vain + 1
            if in_vain and plan.cancelled and self.rig.chain.needs_substeps:
                # An instrument clips: there is no power series to cancel.
                plan, in_vain = self._measured(replace(plan, cancelled=()), pilots, growth), 0
            best = min(best, plan, key=lambda each: each.error)
        if best.error > accuracy and asked is not None:
            raise LabError(
                f"an accuracy of {accuracy:.1e} is out of reach: the error is {best.error:.1e} with {best.substeps} substeps "
                "per sample; ask for less, or sample faster"
            )
        # For the default accuracy, where kinks and lags cap the order, the best will do; its error is on record.
        return replace(self._with(best), accuracy=accuracy)

    def _pilots(self) -> tuple[list[Load], float]:
        """The start of the first records, and the factor by which the error can still grow after it."""
        settled = 2 * stepping.settling_time(self.rig) * self.sample_rate
        n = int(np.clip(settled, PILOT_SAMPLES, MOST_PILOT_SAMPLES))
        whole = self.loads[0].n_samples
        starts = [replace(load, n_samples=min(n, whole), whole=whole) for load in self.loads[:4]]
        return starts, max(1.0, min(settled, whole) / n)

    def _measured(self, plan: Plan, pilots: Sequence[Load], growth: float) -> Plan:
        # What extrapolation leaves of an error in phase grows with its square.
        return replace(plan, error=growth ** (2 if plan.cancelled else 1) * self._error(plan, pilots))

    def _with(self, plan: Plan) -> _Bench:
        return replace(self, plan=plan)

    def _error(self, plan: Plan, pilots: Sequence[Load]) -> float:
        """Largest error, judged by twice the substeps, relative to the largest value of its channel."""
        plans = (plan, stepping.doubled(plan))
        coarse, fine = (
            np.concatenate([part.outputs for part in parts], axis=2)
            for parts in zip(*self._combined(pilots, plans), strict=True)
        )
        difference = np.max(np.abs(coarse - fine), axis=2)  # (n_batch, n_outputs)
        largest = np.max(np.abs(fine), axis=2)
        # A channel across all motion reads rounding only; it has no scale of its own.
        for unit in {channel.unit for channel in self.rig.outputs}:
            same = [channel.unit == unit for channel in self.rig.outputs]
            largest[:, same] = np.maximum(largest[:, same], 1e-6 * np.max(largest[:, same]))
        # The finer run has an error of its own, smaller by the power of two.
        share = 1 - 2.0 ** -stepping.order_left(self.rig, plan)
        return float(np.max(difference / np.where(largest > 0, largest, 1.0))) / share

    def _default_accuracy(self, outputs: Array) -> float:
        """`NOISE_SHARE` of the smallest noise of an output channel, relative to the largest value of the channel."""
        order = _swapped(self.rig)
        largest, rms = np.max(np.abs(outputs), axis=(0, 2))[order], _rms([np.hstack(list(outputs))[order]])
        shares = []
        for row, channel in enumerate(self.rig.outputs):
            stages = self.rig.chain.for_channel("acquisition", channel.name)
            noise = math.hypot(*(stage.noise(1 / self.sample_rate, rms[row]) for stage in stages))
            if noise > 0 and largest[row] > 0:
                shares.append(noise / largest[row])
        return float(np.clip(NOISE_SHARE * min(shares), 1e-12, 1e-4)) if shares else IDEAL_ACCURACY

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
        for (part,) in self._combined(loads, (self.plan,)):
            yield part
            if progress is not None:
                progress(part.outputs.shape[2] * len(loads))

    def _combined(self, loads: Sequence[Load], plans: Sequence[Plan]) -> Iterator[list[Part]]:
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
        order = _swapped(self.rig)
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


def _swapped(rig: Rig) -> list[int]:
    """Which output each recorded channel really carries."""
    names = [channel.name for channel in rig.outputs]
    order = list(range(len(names)))
    for a, b in rig.chain.swaps:
        if a in names and b in names:
            i, j = names.index(a), names.index(b)
            order[i], order[j] = order[j], order[i]
    return order


def _rms(blocks: Iterable[Array]) -> Array:
    """Root mean square of each row over consecutive blocks, summed block by block."""
    total, n = np.zeros(0), 0
    for block in blocks:
        squares = np.sum(np.ascontiguousarray(block) ** 2, axis=1)
        total = total + squares if n else squares
        n += block.shape[1]
    return np.sqrt(total / n)
