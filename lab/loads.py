"""Loads: what one record applies to the structure, block by block, and the noise that many of them are."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from identification.recording import Array
from lab.errors import LabError

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
class BandNoise:
    """Gaussian noise of a given RMS on several rows, white or band-limited, the same for every start."""

    n_rows: int
    rms: float
    band: tuple[float, float] | None
    sampling: Sampling
    seed: int

    def __post_init__(self) -> None:
        band_within(self.band or (0.0, 0.0), self.sampling)

    def blocks(self) -> Iterator[Array]:
        """Pieces of the record, shape (n_rows, at most `BLOCK`)."""
        from scipy.signal import sosfilt  # slow to load, and only random forces need it

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
                block, memory = sosfilt(sections, block, axis=1, zi=memory)
            yield self.rms * scale * block

    def _filter(self) -> tuple[Array | None, float]:
        if self.band is None:
            return None, 1.0
        from scipy.signal import butter  # slow to load, and only bands need it

        low, high = band_within(self.band, self.sampling)
        nyquist = self.sampling.sample_rate / 2
        if low <= 0 and high >= nyquist:
            return None, 1.0
        edges = [edge / nyquist for edge in (low, high) if 0 < edge < nyquist]
        kind = "bandpass" if len(edges) == 2 else "lowpass" if low <= 0 else "highpass"
        sections = butter(FILTER_ORDER, edges if len(edges) == 2 else edges[0], kind, output="sos")
        # White noise of unit variance leaves with the energy of the impulse response, by Parseval's theorem.
        return sections, 1 / math.sqrt(_energy(edges, kind))


def _energy(edges: Sequence[float], kind: str) -> float:
    """Mean power gain of the digital Butterworth filter over all frequencies, as shares of half the sample rate."""
    from scipy.integrate import quad  # slow to load, and only bands need it

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
    return sum(quad(gain, a, b, epsabs=0, epsrel=1e-10)[0] for a, b in itertools.pairwise(points))


def band_within(band: Sequence[float], sampling: Sampling) -> tuple[float, float]:
    """Lowest and highest frequency of a band [Hz]; up to half the sample rate where both are zero.

    Raises:
        LabError: not rising, or beyond half the sample rate.
    """
    low, high = band
    nyquist = sampling.sample_rate / 2
    if (low, high) == (0.0, 0.0):
        return 0.0, nyquist
    if not 0 <= low < high <= nyquist:
        raise LabError(
            f"band is {low} to {high} Hz; expected 0 <= low < high <= {nyquist} Hz, half the sample rate"
        )
    return float(low), float(high)
