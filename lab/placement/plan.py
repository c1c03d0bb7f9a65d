"""Plan: the test for which sensors and actuators are placed: its signals, rate and noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identification.recording import Array, Channel
from lab.errors import LabError
from lab.excitation import EXCITATIONS, Excitation
from lab.loads import Sampling
from lab.rig import Rig

SAMPLES_PER_PERIOD, PERIODS = 8, 100
"""Of the highest mode, and of the lowest, in a test of which nothing else is said."""

KINDS = ("random", "burst_random", "multisine", "sweep", "pulse")
"""Signals that are compared."""

LEVELS = (0.1, 1.0, 10.0)
"""Forces that are compared, as shares of the planned ones."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A test that is planned.

    Attributes:
        excitation: how every actuator is driven.
        sample_rate: [Hz].
        duration: of each record [s].
        n_runs: how often the test is repeated.
        noise_percent: white noise on every output, in percent of its RMS in the record.
        noise: standard deviation by unit, in place of `noise_percent` where not empty.
        seed: of random signals.
    """

    excitation: Excitation
    sample_rate: float
    duration: float
    n_runs: int = 1
    noise_percent: float = 1.0
    noise: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0

    def __post_init__(self) -> None:
        for what, value in (
            ("sample_rate", self.sample_rate),
            ("duration", self.duration),
            ("noise_percent", self.noise_percent),
            *((f"noise of {unit}", std) for unit, std in self.noise.items()),
        ):
            if not (np.isfinite(value) and value > 0):
                raise LabError(f"{what} is {value}; expected a positive number")

    def signals(self, rig: Rig, acting: Sequence[int] | None = None) -> list[tuple[str, Array]]:
        """Kind and inputs (n_inputs, n_samples) of each record, for every connected actuator.

        Args:
            rig: with the actuators connected.
            acting: positions of those that act; the others rest, and records in which nothing acts are left out. All
                of them, in all records, when None.

        Raises:
            LabError: the excitation leaves the forces unknown.
        """
        sampling = Sampling(self.sample_rate, round(self.duration * self.sample_rate))
        rng, found = np.random.default_rng(self.seed), []
        for _ in range(self.n_runs):
            for load in self.excitation.loads(rig, sampling, rng):
                if not load.measured:
                    raise LabError(
                        f"excitation {load.kind!r} leaves the forces unknown; expected one that measures them, such as random"
                    )
                found.append((load.kind, np.concatenate([u for u, _ in load.blocks()], axis=1)))
        if acting is None:
            return found
        rests = np.setdiff1d(np.arange(len(rig.inputs)), acting)
        for _, u in found:
            u[rests] = 0.0
        return [(kind, u) for kind, u in found if np.any(u)]

    def noise_std(self, outputs: tuple[Channel, ...], rms: Array) -> Array:
        """Standard deviation of the noise, shape of `rms`; infinite where an output feels nothing.

        Args:
            outputs: channels.
            rms: of the signal of each record and output, shape (n_records, n_outputs).

        Raises:
            LabError: no noise is given for a unit.
        """
        if self.noise:
            lacking = sorted({channel.unit for channel in outputs} - set(self.noise))
            if lacking:
                raise LabError(
                    f"no noise is given for sensors in {', '.join(lacking)}; expected one number for each unit"
                )
            std = np.array([self.noise[channel.unit] for channel in outputs])
            return np.broadcast_to(std, rms.shape)
        felt = rms > 1e-12 * np.max(rms, axis=0, initial=0.0)
        return np.where(felt & (rms > 0), rms * self.noise_percent / 100, np.inf)

    def driven(self, excitation: Excitation) -> Plan:
        """The same test with another excitation."""
        return replace(self, excitation=excitation)


def usual_plan(
    frequency_hz: Array,
    *,
    excitation: str = "random",
    level: float | None = None,
    sample_rate: float | None = None,
    duration: float | None = None,
    noise_percent: float = 1.0,
    noise: Mapping[str, float] | None = None,
    seed: int = 0,
) -> Plan:
    """A test that suits a structure: eight samples in a period of its highest mode, a hundred periods of its lowest.

    Args:
        frequency_hz: natural frequencies.
        excitation: kind, as in `EXCITATIONS`.
        level: amplitude or RMS of the signal [N]; one when None.
        sample_rate: [Hz].
        duration: of each record [s].
        noise_percent, noise, seed: as for `Plan`.

    Raises:
        LabError: unknown excitation.
    """
    rate = float(SAMPLES_PER_PERIOD * np.max(frequency_hz)) if sample_rate is None else sample_rate
    length = float(PERIODS / np.min(frequency_hz)) if duration is None else duration
    plan = Plan(EXCITATIONS["random"](), rate, length, 1, noise_percent, noise or {}, seed)
    return plan.driven(driving(excitation, level, band=band_of(frequency_hz, rate)))


def band_of(frequency_hz: Array, sample_rate: float) -> tuple[float, float]:
    """From half the lowest natural frequency to a fifth above the highest, below half the sample rate [Hz]."""
    return 0.5 * float(np.min(frequency_hz)), min(1.2 * float(np.max(frequency_hz)), 0.49 * sample_rate)


def driving(kind: str, level: float | None = None, *, band: tuple[float, float]) -> Excitation:
    """The excitation of that kind, at an amplitude or RMS [N].

    Args:
        kind: as in `EXCITATIONS`.
        level: amplitude or RMS; as it comes when None.
        band: of signals that must have one [Hz].

    Raises:
        LabError: unknown kind, or an impossible level.
    """
    if kind not in EXCITATIONS:
        raise LabError(f"excitation is {kind!r}; expected one of {', '.join(EXCITATIONS)}")
    made = EXCITATIONS[kind]()
    if getattr(made, "band", None) == (0.0, 0.0):
        made = replace(made, **{"band": band})
    name = next((name for name in ("amplitude", "rms") if hasattr(made, name)), None)
    if level is None or name is None:
        return made
    if not (np.isfinite(level) and level > 0):
        raise LabError(f"level is {level}; expected a positive number")
    return replace(made, **{name: level})


def driving_level(excitation: Excitation, factor: float) -> Excitation:
    """The same excitation with all forces multiplied by a factor."""
    name = next((name for name in ("amplitude", "rms") if hasattr(excitation, name)), None)
    if name is None:
        raise LabError(f"excitation {excitation.kind!r} has no level; expected an amplitude or RMS")
    return replace(excitation, **{name: factor * getattr(excitation, name)})


def peak(signals: Sequence[tuple[str, Array]]) -> float:
    """Largest force of a test [N]."""
    return max(float(np.max(np.abs(u), initial=0.0)) for _, u in signals)


def total_duration(signals: Sequence[tuple[str, Array]], sample_rate: float) -> float:
    """Length of all records of a test together in which something acts [s]."""
    return sum(u.shape[1] for _, u in signals if np.any(u)) / sample_rate


def alternatives(
    rig: Rig, plan: Plan, frequency_hz: Array, acting: Sequence[int] | None = None
) -> Iterator[tuple[str, Plan]]:
    """The same test with other signals of the same largest force, and at other levels, each with its name.

    Args:
        rig: with the actuators connected.
        plan: whose rate, length, noise and largest force are kept.
        frequency_hz: natural frequencies that signals with a band shall cover.
        acting: positions of the actuators that act; all when None.
    """
    largest, band = peak(plan.signals(rig, acting)), band_of(frequency_hz, plan.sample_rate)
    for kind in KINDS:
        own = peak(plan.driven(driving(kind, 1.0, band=band)).signals(rig, acting))
        yield kind, plan.driven(driving(kind, largest / own, band=band))
    for level in LEVELS:
        yield (
            f"{plan.excitation.kind} as planned, times {level:g}",
            plan.driven(driving_level(plan.excitation, level)),
        )
