"""Stages of the measurement chain: the things that happen to a signal, each with the settings of a data sheet."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from numbers import Real
from typing import ClassVar

import numpy as np

from identification.recording import Array
from lab.errors import RigError
from lab.filters import band_limited_delay, band_limited_lag, held_low_pass, low_pass

Process = Callable[[Array], Array]
"""Turns the next block of a signal into what leaves the stage; remembers the blocks before."""

ALL = "*"
"""Stands for every channel."""


@dataclass(frozen=True)
class Stage:
    """One thing that happens to a signal.

    Attributes:
        channel: name of the channel it happens to, or "*" for every channel.

    Raises:
        RigError: a setting is no number, or out of its bounds.
    """

    name: ClassVar[str] = ""
    at_samples: ClassVar[bool] = False
    whole_record: ClassVar[bool] = False
    positive: ClassVar[tuple[str, ...]] = ()
    not_negative: ClassVar[tuple[str, ...]] = ()
    channel: str

    def __post_init__(self) -> None:
        for setting in fields(self)[1:]:
            value = getattr(self, setting.name)
            if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
                bound, good = "a finite number", False
            elif setting.name in self.positive:
                bound, good = "a positive number", float(value) > 0
            else:
                bound, good = (
                    "a number of at least 0",
                    setting.name not in self.not_negative or float(value) >= 0,
                )
            if not good:
                raise RigError(
                    f"{setting.name} of stage {self.name!r} on {self.channel!r} is {value!r}; expected {bound}"
                )

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        """A process for one channel of one record.

        Args:
            dt: time between values of the signal [s].
            rng: source of the stage's randomness.
            rms: root mean square of the signal over the whole record, where known.
        """
        raise NotImplementedError

    def start_held(self, dt: float) -> Process:
        """A process for one force, shape (3, n): just after the start, mean, and just before the end of each substep."""
        return self.start(dt, np.random.default_rng(0), 0.0)

    @property
    def needs_substeps(self) -> bool:
        """Whether the stage must see what happens between samples."""
        return False

    @property
    def needs_samples(self) -> bool:
        """Whether the stage makes sense for samples only."""
        return False

    def noise(self, dt: float, rms: float) -> float:
        """Standard deviation of the random error of one value, for a signal of that root mean square."""
        return 0.0


@dataclass(frozen=True)
class Gain(Stage):
    """Multiplies the signal by 1 + `relative_change`; -2 flips its sign."""

    name: ClassVar[str] = "gain"
    relative_change: float

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        return lambda x: x * (1 + self.relative_change)


@dataclass(frozen=True)
class Saturation(Stage):
    """Clips the signal at ±`limit` [unit of the channel]."""

    name: ClassVar[str] = "saturation"
    positive: ClassVar[tuple[str, ...]] = ("limit",)
    limit: float

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        return lambda x: np.clip(x, -self.limit, self.limit)


@dataclass(frozen=True)
class Lag(Stage):
    """First-order low-pass of corner frequency `corner_hz`; a lag of time constant 1 / (2π corner_hz)."""

    name: ClassVar[str] = "lag"
    positive: ClassVar[tuple[str, ...]] = ("corner_hz",)
    corner_hz: float

    @property
    def needs_substeps(self) -> bool:
        return True

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        return low_pass(self.corner_hz, 1, dt)

    def start_held(self, dt: float) -> Process:
        return held_low_pass(self.corner_hz, 1, dt)


@dataclass(frozen=True)
class HeldLag(Stage):
    """First-order lag of an actuator whose lagging force is held over each sample, as a digital controller gives it."""

    name: ClassVar[str] = "held_lag"
    at_samples: ClassVar[bool] = True
    positive: ClassVar[tuple[str, ...]] = ("time_constant",)
    time_constant: float

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        from scipy.signal import lfilter  # slow to load, and only lags need it

        share = -np.expm1(-dt / self.time_constant)
        memory = np.zeros(1)

        def process(x: Array) -> Array:
            nonlocal memory
            y, memory = lfilter([share], [1, share - 1], x, zi=memory)
            return np.asarray(y)

        return process


@dataclass(frozen=True)
class BandLimitedLag(Stage):
    """First-order low-pass of corner frequency `corner_hz` on a signal that an ideal anti-alias filter has limited."""

    name: ClassVar[str] = "band_limited_lag"
    whole_record: ClassVar[bool] = True
    positive: ClassVar[tuple[str, ...]] = ("corner_hz",)
    corner_hz: float

    @property
    def needs_samples(self) -> bool:
        return True

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        return lambda x: band_limited_lag(x, 1 / (2 * np.pi * self.corner_hz), dt)


@dataclass(frozen=True)
class BandLimitedDelay(Stage):
    """Gives a signal that an ideal anti-alias filter has limited `delay` seconds later."""

    name: ClassVar[str] = "band_limited_delay"
    whole_record: ClassVar[bool] = True
    not_negative: ClassVar[tuple[str, ...]] = ("delay",)
    delay: float

    @property
    def needs_samples(self) -> bool:
        return True

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        return lambda x: band_limited_delay(x, self.delay, dt)


@dataclass(frozen=True)
class LowPass(Stage):
    """Butterworth low-pass of `order` with corner frequency `corner_hz`, as in an anti-alias filter."""

    name: ClassVar[str] = "low_pass"
    positive: ClassVar[tuple[str, ...]] = ("corner_hz", "order")
    corner_hz: float
    order: int = 2

    @property
    def needs_substeps(self) -> bool:
        return True

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        return low_pass(self.corner_hz, self.order, dt)

    def start_held(self, dt: float) -> Process:
        return held_low_pass(self.corner_hz, self.order, dt)


@dataclass(frozen=True)
class Delay(Stage):
    """Gives the signal `delay` seconds later; before the record it stood still."""

    name: ClassVar[str] = "delay"
    not_negative: ClassVar[tuple[str, ...]] = ("delay",)
    delay: float

    @property
    def needs_substeps(self) -> bool:
        return True

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        whole, part = _delay_line(self.delay, dt)
        past: Array | None = None

        def process(x: Array) -> Array:
            nonlocal past
            if past is None:
                past = np.full((3, whole + 1), x[0, 0])
            line, n = np.concatenate([past, x], axis=1), x.shape[1]
            past = line[:, n:]
            earlier, late = line[:, :n], line[:, 1 : n + 1]
            if not part:
                return late
            # Between two instants the signal runs from just after the earlier to just before the later.
            mixed = part * earlier[1] + (1 - part) * late[0]
            return np.stack([mixed, mixed, mixed])

        return process

    def start_held(self, dt: float) -> Process:
        whole, part = _delay_line(self.delay, dt)
        past = np.zeros((3, whole + 1))

        def process(x: Array) -> Array:
            nonlocal past
            line, n = np.concatenate([past, x], axis=1), x.shape[1]
            past = line[:, n:]
            earlier, late = line[:, :n], line[:, 1 : n + 1]
            if not part:
                return late
            return np.stack([earlier[2], part * earlier[1] + (1 - part) * late[1], late[0]])

        return process


@dataclass(frozen=True)
class Hum(Stage):
    """Adds a sine of `frequency_hz` and `amplitude` [unit of the channel]; `phase` [rad] at the start of the record."""

    name: ClassVar[str] = "hum"
    not_negative: ClassVar[tuple[str, ...]] = ("frequency_hz",)
    frequency_hz: float
    amplitude: float
    phase: float = 0.0

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        passed = 0

        def process(x: Array) -> Array:
            nonlocal passed
            t = (passed + np.arange(x.shape[-1])) * dt
            passed += x.shape[-1]
            return x + self.amplitude * np.sin(2 * np.pi * self.frequency_hz * t + self.phase)

        return process

    def start_held(self, dt: float) -> Process:
        rng, turn = np.random.default_rng(0), 2 * np.pi * self.frequency_hz * dt
        # The mean over a substep is the value at its middle, a little less.
        middle = dataclasses.replace(self, amplitude=self.amplitude * float(np.sinc(turn / (2 * np.pi))))
        sines = [
            dataclasses.replace(hum, phase=self.phase + part * turn)
            for hum, part in ((self, 0), (middle, 0.5), (self, 1))
        ]
        rows = [sine.start(dt, rng, 0.0) for sine in sines]
        return lambda x: np.stack([process(row) for process, row in zip(rows, x, strict=True)])


@dataclass(frozen=True)
class Noise(Stage):
    """Adds white Gaussian noise; the three kinds add up.

    Attributes:
        percent: standard deviation as a percentage of the record's own RMS in this channel.
        std: standard deviation [unit of the channel].
        density: spectral density [unit / √Hz], up to half the sample rate.
    """

    name: ClassVar[str] = "noise"
    not_negative: ClassVar[tuple[str, ...]] = ("percent", "std", "density")
    percent: float = 0.0
    std: float = 0.0
    density: float = 0.0

    @property
    def needs_samples(self) -> bool:
        return True

    def noise(self, dt: float, rms: float) -> float:
        return math.sqrt((self.percent / 100 * rms) ** 2 + self.std**2 + self.density**2 / (2 * dt))

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        sigma = self.noise(dt, rms)
        return lambda x: x + sigma * rng.standard_normal(x.shape)


@dataclass(frozen=True)
class Resolution(Stage):
    """Rounds to whole multiples of `step` [unit of the channel], as a converter of finite bits does."""

    name: ClassVar[str] = "resolution"
    positive: ClassVar[tuple[str, ...]] = ("step",)
    step: float

    def noise(self, dt: float, rms: float) -> float:
        return self.step / math.sqrt(12)

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        return lambda x: np.round(x / self.step) * self.step


@dataclass(frozen=True)
class Dropout(Stage):
    """Loses single samples with the given probability; a lost sample is NaN."""

    name: ClassVar[str] = "dropout"
    not_negative: ClassVar[tuple[str, ...]] = ("probability",)
    probability: float

    @property
    def needs_samples(self) -> bool:
        return True

    def start(self, dt: float, rng: np.random.Generator, rms: float) -> Process:
        return lambda x: np.where(rng.random(x.shape) < self.probability, np.nan, x)


STAGES: dict[str, type[Stage]] = {
    stage.name: stage
    for stage in (
        Gain,
        Saturation,
        Lag,
        HeldLag,
        BandLimitedLag,
        BandLimitedDelay,
        LowPass,
        Delay,
        Hum,
        Noise,
        Resolution,
        Dropout,
    )
}


def _delay_line(delay: float, dt: float) -> tuple[int, float]:
    """Whole steps of a delay and the remaining part of one."""
    whole = int(np.floor(delay / dt + 1e-9))
    part = delay / dt - whole
    return whole, part if part > 1e-9 else 0.0
