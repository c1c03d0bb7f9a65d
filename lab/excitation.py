"""Excitations: how a test drives the structure. Each one turns a seed into loads, one load per record."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import ClassVar

import numpy as np
import scipy.integrate
import scipy.signal

from identification.recording import Array
from lab.errors import LabError, UnknownNameError
from lab.rig import Rig

BLOCK = 4096
"""Samples per block of a load; fixed, so that no result depends on how a simulation cuts its work."""

FILTER_ORDER = 6
"""Order of the Butterworth filter at each edge of a band."""

Blocks = Iterator[tuple[Array, Array | None]]


@dataclass(frozen=True, eq=False)
class Load:
    """What one record applies to the structure.

    Attributes:
        kind: record kind of the recording file.
        n_samples: length.
        blocks: starts an iterator over commanded inputs (n_inputs, m) and unmeasured forces on the degrees of freedom
            (n_dofs, m), or None when there are none; the same values every time.
        position: displacement from the operating point at the start, shape (n_dofs,) [m or rad].
        velocity: shape (n_dofs,) [m/s or rad/s].
        measured: whether the inputs are recorded.
        number: of the record in its recording.
        whole: samples of the whole record, where this is only its start; 0 where it is all of it.
    """

    kind: str
    n_samples: int
    blocks: Callable[[], Blocks]
    position: Array
    velocity: Array
    measured: bool = True
    number: int = 0
    whole: int = 0

    @property
    def n_record(self) -> int:
        """Samples of the whole record."""
        return self.whole or self.n_samples


@dataclass(frozen=True)
class Sampling:
    """Rate [Hz] and length of every record."""

    sample_rate: float
    n_samples: int

    @property
    def time(self) -> Array:
        """Instants of the samples [s]."""
        return np.arange(self.n_samples) / self.sample_rate


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
        low, high = _band(self.band, sampling)
        if self.law not in ("linear", "logarithmic"):
            raise LabError(f"sweep law is {self.law!r}; expected 'linear' or 'logarithmic'")
        if self.law == "logarithmic" and low <= 0:
            raise LabError(
                f"a logarithmic sweep cannot start at {low} Hz; give a band that starts above zero"
            )
        duration = sampling.n_samples / sampling.sample_rate
        shape = scipy.signal.chirp(sampling.time, low, duration, high, method=self.law, phi=-90)
        return _one_by_one(self.kind, rig, self.amplitude * shape)


@dataclass(frozen=True)
class Random(Excitation):
    """Gaussian noise of `rms` on all inputs at once, white or limited to `band` [Hz]."""

    kind: ClassVar[str] = "random"
    rms: float = 1.0
    band: tuple[float, float] | None = None

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        _require(self, from_zero=("rms",))
        noise = _Noise(len(rig.inputs), self.rms, self.band, sampling, _seed(rng))
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
        noise = _Noise(len(rig.inputs), self.rms, self.band, sampling, _seed(rng))
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
        low, high = _band(self.band, sampling)
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
        noise = _Noise(len(rows), self.rms, self.band, sampling, _seed(rng))

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


@dataclass(frozen=True)
class _Noise:
    """Gaussian noise of a given RMS on several rows, white or band-limited, the same for every start."""

    n_rows: int
    rms: float
    band: tuple[float, float] | None
    sampling: Sampling
    seed: int

    def __post_init__(self) -> None:
        _band(self.band or (0.0, 0.0), self.sampling)

    def blocks(self) -> Iterator[Array]:
        rng = np.random.default_rng(self.seed)
        sections, scale = self._filter()
        memory = (
            np.zeros((0, self.n_rows, 2)) if sections is None else np.zeros((len(sections), self.n_rows, 2))
        )
        for first in range(0, self.sampling.n_samples, BLOCK):
            n = min(BLOCK, self.sampling.n_samples - first)
            # Drawn sample by sample across the rows, so that a shorter record is the start of a longer one.
            block = rng.standard_normal((n, self.n_rows)).T
            if sections is not None:
                block, memory = scipy.signal.sosfilt(sections, block, axis=1, zi=memory)
            yield self.rms * scale * block

    def _filter(self) -> tuple[Array | None, float]:
        if self.band is None:
            return None, 1.0
        low, high = _band(self.band, self.sampling)
        nyquist = self.sampling.sample_rate / 2
        if low <= 0 and high >= nyquist:
            return None, 1.0
        edges = [edge / nyquist for edge in (low, high) if 0 < edge < nyquist]
        kind = "bandpass" if len(edges) == 2 else "lowpass" if low <= 0 else "highpass"
        sections = scipy.signal.butter(
            FILTER_ORDER, edges if len(edges) == 2 else edges[0], kind, output="sos"
        )
        # White noise of unit variance leaves with the energy of the impulse response, by Parseval's theorem.
        return sections, 1 / math.sqrt(_energy(edges, kind))


def _energy(edges: Sequence[float], kind: str) -> float:
    """Mean power gain of the digital Butterworth filter over all frequencies, as shares of half the sample rate."""
    corners = [math.tan(math.pi * edge / 2) for edge in edges]

    def gain(share: float) -> float:
        w = math.tan(math.pi * share / 2)
        if kind == "bandpass":
            x = (w * w - corners[0] * corners[1]) / ((corners[1] - corners[0]) * w)
        else:
            x = w / corners[0] if kind == "lowpass" else corners[0] / w
        return 1 / (1 + x ** (2 * FILTER_ORDER))

    # Closer and closer to the edges, so that no narrow band is overlooked.
    width = edges[1] - edges[0] if kind == "bandpass" else min(edges[0], 1 - edges[0])
    near = [edge + side * width * 4.0**k for edge in edges for side in (-1, 0, 1) for k in range(-1, 20)]
    points = [0.0, *sorted({point for point in near if 0 < point < 1}), 1.0]
    return sum(
        scipy.integrate.quad(gain, a, b, epsabs=0, epsrel=1e-10)[0] for a, b in itertools.pairwise(points)
    )


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


def _band(band: Sequence[float], sampling: Sampling) -> tuple[float, float]:
    low, high = band
    nyquist = sampling.sample_rate / 2
    if (low, high) == (0.0, 0.0):
        return 0.0, nyquist
    if not 0 <= low < high <= nyquist:
        raise LabError(
            f"band is {low} to {high} Hz; expected 0 <= low < high <= {nyquist} Hz, half the sample rate"
        )
    return float(low), float(high)


def _dof(rig: Rig, name: str) -> int:
    if name not in rig.dofs:
        raise UnknownNameError(f"degree of freedom {name!r} does not exist; there are {', '.join(rig.dofs)}")
    return rig.dofs.index(name)


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(0, 2**63))
