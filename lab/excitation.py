"""Excitations: how a test drives the structure. Each one turns a seed into loads, one load per record."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import ClassVar

import numpy as np

from identification.recording import Array
from lab.errors import LabError, UnknownNameError
from lab.loads import BLOCK, BandNoise, Blocks, Load, Sampling, band_within
from lab.rig import Rig


@dataclass(frozen=True)
class Excitation:
    """One way to drive a structure; settings are in SI units."""

    kind: ClassVar[str] = ""

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        """The loads of one run of the test, in the order in which they are recorded."""
        raise NotImplementedError


@dataclass(frozen=True)
class Pulse(Excitation):
    """A force of `amplitude` [input unit] held for the first sample, on one input after the other, a record each."""

    kind: ClassVar[str] = "pulse"
    amplitude: float = 1.0

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        _require(self)
        shape = np.zeros(sampling.n_samples)
        shape[0] = self.amplitude
        return _one_by_one(self.kind, rig, shape)


@dataclass(frozen=True)
class Impact(Excitation):
    """A half-sine hammer blow of peak `amplitude` and `width` [s] at time `start` [s], on one input after the other."""

    kind: ClassVar[str] = "impact"
    amplitude: float = 100.0
    width: float = 0.01
    start: float = 0.0

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        _require(self, above_zero=("width",), from_zero=("start",))
        if (self.start + self.width) * sampling.sample_rate > sampling.n_samples:
            raise LabError(
                f"the blow ends at {self.start + self.width:.6g} s, after the record of "
                f"{sampling.n_samples / sampling.sample_rate} s; strike earlier or record longer"
            )
        edges = np.arange(sampling.n_samples + 1) / sampling.sample_rate
        phase = np.clip((edges - self.start) / self.width, 0, 1) * np.pi
        # A sample holds the mean force, so that the blow keeps its momentum however short it is.
        momentum = -np.cos(phase) * self.amplitude * self.width / np.pi
        return _one_by_one(self.kind, rig, np.diff(momentum) * sampling.sample_rate)


@dataclass(frozen=True)
class Sweep(Excitation):
    """A sine of `amplitude` through `band` [Hz] over the record, on one input after the other.

    The frequency rises linearly, or by equal ratios when `law` is "logarithmic".
    """

    kind: ClassVar[str] = "sweep"
    amplitude: float = 1.0
    band: tuple[float, float] = (0.0, 0.0)
    law: str = "linear"

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        _require(self)
        low, high = band_within(self.band, sampling)
        if self.law not in ("linear", "logarithmic"):
            raise LabError(f"sweep law is {self.law!r}; expected 'linear' or 'logarithmic'")
        if self.law == "logarithmic" and low <= 0:
            raise LabError(
                f"a logarithmic sweep cannot start at {low} Hz; give a band that starts above zero"
            )
        from scipy.signal import chirp  # slow to load, and only sweeps need it

        duration = sampling.n_samples / sampling.sample_rate
        shape = chirp(sampling.time, low, duration, high, method=self.law, phi=-90)
        return _one_by_one(self.kind, rig, self.amplitude * shape)


@dataclass(frozen=True)
class Random(Excitation):
    """Gaussian noise of `rms` on all inputs at once, white or limited to `band` [Hz]."""

    kind: ClassVar[str] = "random"
    rms: float = 1.0
    band: tuple[float, float] | None = None

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        _require(self, from_zero=("rms",))
        noise = BandNoise(len(rig.inputs), self.rms, self.band, sampling, _seed(rng))
        return [_load(self.kind, rig, sampling, lambda: ((block, None) for block in noise.blocks()))]


@dataclass(frozen=True)
class BurstRandom(Excitation):
    """Noise as in `Random` over the first `burst` share of the record, then silence while the structure rings down."""

    kind: ClassVar[str] = "burst_random"
    rms: float = 1.0
    band: tuple[float, float] | None = None
    burst: float = 0.5

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        _require(self, from_zero=("rms", "burst"))
        if self.burst > 1:
            raise LabError(f"burst is {self.burst}; expected a share of the record, from 0 to 1")
        noise = BandNoise(len(rig.inputs), self.rms, self.band, sampling, _seed(rng))
        last = round(self.burst * sampling.n_samples)

        def blocks() -> Blocks:
            first = 0
            for block in noise.blocks():
                yield np.where(first + np.arange(block.shape[1]) < last, block, 0.0), None
                first += block.shape[1]

        return [_load(self.kind, rig, sampling, blocks)]


@dataclass(frozen=True)
class Multisine(Excitation):
    """Sines at every multiple of 1 / `period` in `band`, equal amplitudes, random phases, on all inputs at once.

    The period [s] is the whole record when None.
    """

    kind: ClassVar[str] = "multisine"
    rms: float = 1.0
    band: tuple[float, float] = (0.0, 0.0)
    period: float | None = None

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        _require(self, above_zero=("period",), from_zero=("rms",))
        low, high = band_within(self.band, sampling)
        n = sampling.n_samples if self.period is None else self._period_samples(sampling)
        number = np.arange(n // 2 + 1)
        lines, near = number * sampling.sample_rate / n, 1e-9 * sampling.sample_rate / n
        used = (lines > low - near) & (lines < high + near) & (number > 0) & (2 * number < n)
        if not used.any():
            raise LabError(
                f"a period of {n} samples has no line between {low} and {high} Hz; lengthen it or widen the band"
            )
        phases = rng.uniform(0, 2 * np.pi, (len(rig.inputs), lines.size))
        one = np.fft.irfft(used * np.exp(1j * phases), n)
        one *= self.rms / np.sqrt(np.mean(one**2, axis=1, keepdims=True))

        def blocks() -> Blocks:
            for first in range(0, sampling.n_samples, BLOCK):
                k = np.arange(first, min(first + BLOCK, sampling.n_samples))
                yield one[:, k % n], None

        return [_load(self.kind, rig, sampling, blocks)]

    def _period_samples(self, sampling: Sampling) -> int:
        assert self.period is not None
        n = round(self.period * sampling.sample_rate)
        if abs(n - self.period * sampling.sample_rate) > 1e-6 * n:
            raise LabError(
                f"a period of {self.period} s is {self.period * sampling.sample_rate:.6g} samples; expected a whole number of "
                f"samples, as {max(n, 1) / sampling.sample_rate:.9g} s is"
            )
        return n


@dataclass(frozen=True)
class Ambient(Excitation):
    """Unmeasured Gaussian forces of `rms` [N] on the degrees of freedom `dofs` (all when None); no input is recorded."""

    kind: ClassVar[str] = "ambient"
    rms: float = 1.0
    band: tuple[float, float] | None = None
    dofs: tuple[str, ...] | None = None

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        _require(self, from_zero=("rms",))
        rows = [_dof(rig, name) for name in (rig.dofs if self.dofs is None else self.dofs)]
        if not rows or len(set(rows)) < len(rows):
            raise LabError(
                f"ambient dofs are {self.dofs}; expected at least one degree of freedom, each once"
            )
        noise = BandNoise(len(rows), self.rms, self.band, sampling, _seed(rng))

        def blocks() -> Blocks:
            for block in noise.blocks():
                forces = np.zeros((len(rig.dofs), block.shape[1]))
                forces[rows] = block
                yield np.zeros((len(rig.inputs), block.shape[1])), forces

        return [_load(self.kind, rig, sampling, blocks, measured=False)]


@dataclass(frozen=True)
class FreeDecay(Excitation):
    """Release from `displacement` [m or rad] and `velocity` [m/s or rad/s], given per degree of freedom; no force."""

    kind: ClassVar[str] = "free_decay"
    displacement: Mapping[str, float] = field(default_factory=dict)
    velocity: Mapping[str, float] = field(default_factory=dict)

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        for name, value in (*self.displacement.items(), *self.velocity.items()):
            if not np.isfinite(value):
                raise LabError(f"the release of {name!r} is {value}; expected a finite number")
        if not any(self.displacement.values()) and not any(self.velocity.values()):
            raise LabError(
                "a free decay starts at rest; give a displacement or a velocity for a degree of freedom"
            )
        start = []
        for given in (self.displacement, self.velocity):
            values = np.zeros(len(rig.dofs))
            for name, value in given.items():
                values[_dof(rig, name)] = value
            start.append(values)

        def blocks() -> Blocks:
            for first in range(0, sampling.n_samples, BLOCK):
                yield np.zeros((len(rig.inputs), min(BLOCK, sampling.n_samples - first))), None

        return [Load(self.kind, sampling.n_samples, blocks, start[0], start[1], measured=False)]


EXCITATIONS: dict[str, type[Excitation]] = {
    excitation.kind: excitation
    for excitation in (Pulse, Impact, Random, BurstRandom, Sweep, Multisine, Ambient, FreeDecay)
}


def _require(
    excitation: Excitation, *, above_zero: Sequence[str] = (), from_zero: Sequence[str] = ()
) -> None:
    """Checks that all numbers among the settings are finite, and on the right side of zero."""
    for each in fields(excitation):
        value = getattr(excitation, each.name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        good = np.isfinite(value) and not (each.name in above_zero and value <= 0)
        if not good or (each.name in from_zero and value < 0):
            raise LabError(
                f"{each.name} of a test of kind {excitation.kind!r} is {value}; expected a finite number"
                + (
                    " above zero"
                    if each.name in above_zero
                    else " from zero"
                    if each.name in from_zero
                    else ""
                )
            )


def _load(
    kind: str, rig: Rig, sampling: Sampling, blocks: Callable[[], Blocks], *, measured: bool = True
) -> Load:
    rest = np.zeros(len(rig.dofs))
    if measured and not rig.inputs:
        raise LabError(
            f"a test of kind {kind!r} needs an actuator, and model {rig.name!r} has none connected; add a <motor> to the "
            "model or use 'ambient' or 'free_decay'"
        )
    return Load(kind, sampling.n_samples, blocks, rest, rest, measured)


def _one_by_one(kind: str, rig: Rig, shape: Array) -> list[Load]:
    """One record per input, that input driven by `shape` and the others silent."""

    def on(row: int) -> Callable[[], Blocks]:
        def blocks() -> Blocks:
            for first in range(0, shape.size, BLOCK):
                part = shape[first : first + BLOCK]
                inputs = np.zeros((len(rig.inputs), part.size))
                inputs[row] = part
                yield inputs, None

        return blocks

    sampling = Sampling(1.0, shape.size)
    return [_load(kind, rig, sampling, on(row)) for row in range(max(len(rig.inputs), 1))]


def _dof(rig: Rig, name: str) -> int:
    if name not in rig.dofs:
        raise UnknownNameError(f"degree of freedom {name!r} does not exist; there are {', '.join(rig.dofs)}")
    return rig.dofs.index(name)


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(0, 2**63))
