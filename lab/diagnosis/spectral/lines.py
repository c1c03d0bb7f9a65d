"""Lines: cross-spectra of recorded outputs, averaged over bands narrow enough for every resonance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from identification.recording import Array
from lab.errors import LabError
from lab.plant import Plant

Complex = NDArray[np.complex128]

TAPER = 0.05
"""Share of a piece over which a cosine rises at its start and falls at its end (Bendat and Piersol 2010, 11.5.2)."""
WIDTH = 0.5
"""Width of a band in half bandwidths of the nearest resonance."""
SHARPEST = 0.02
"""Damping ratio that bands resolve in any case: what the model leaves out may be sharper than all it has."""
FIRST = 3
"""Lowest line used: below, the offset of a sensor leaks in."""
SHORTEST = 64
"""Samples of the shortest piece worth a spectrum."""


@dataclass(frozen=True, eq=False)
class Bands:
    """Bands of neighbouring Fourier lines.

    Attributes:
        frequency_hz: middle of each band, (n_bands,).
        spread: standard deviation of frequency that a band averages over, window included (n_bands,) [Hz].
        first, last: numbers of its first and last line, (n_bands,).
        length: samples of a piece.
        dt: sample time [s].
    """

    frequency_hz: Array
    spread: Array
    first: NDArray[np.intp]
    last: NDArray[np.intp]
    length: int
    dt: float

    @property
    def nodes(self) -> Array:
        """Two frequencies for each band whose mean is that over the band up to the third order, (2, n_bands) [Hz]."""
        return np.stack([self.frequency_hz - self.spread, self.frequency_hz + self.spread])


@dataclass(frozen=True, eq=False)
class Averages:
    """Cross-spectra averaged over bands.

    Attributes:
        bands: where.
        values: E[y yᴴ] of one Fourier line of unit power in white noise of unit variance, (n_bands, n_outputs, n_outputs).
        counts: effective number of independent lines averaged, (n_bands,).
    """

    bands: Bands
    values: Complex
    counts: np.ndarray


def half_bandwidth(plant: Plant, frequency_hz: np.ndarray) -> Array:
    """Half the half-power bandwidth of the sharpest resonance that may lie at each frequency, ζ f [Hz].

    Away from the resonances of the plant it widens with the square of frequency, and no faster than by a fifth of the
    distance, so that no band reaches over a resonance.
    """
    n = plant.n_dofs
    A = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [-np.linalg.solve(plant.mass, np.hstack([plant.stiffness, plant.damping]))],
        ]
    )
    poles = np.linalg.eigvals(A)
    poles = poles[(poles.imag > 0) & (poles.real < 0)]
    if not poles.size:
        return np.full(frequency_hz.shape, np.inf)
    at, half = np.abs(poles) / (2 * np.pi), -poles.real / (2 * np.pi)
    ratio = np.maximum(frequency_hz[:, None] / at, at / np.maximum(frequency_hz[:, None], 1e-300))
    near = half + 0.2 * np.abs(frequency_hz[:, None] - at)
    return np.asarray(np.min(np.minimum(half * ratio**2, near), axis=1))


def bands_for(plant: Plant, length: int, dt: float, *, band: tuple[float, float] | None = None) -> Bands:
    """Bands for pieces of that many samples.

    Args:
        plant: whose resonances set the widths.
        length: samples of a piece.
        dt: sample time [s].
        band: lowest and highest frequency used [Hz]; all when None.

    Raises:
        LabError: no line lies in the band.
    """
    spacing = 1 / (length * dt)
    low, high = band if band is not None else (0.0, np.inf)
    lines = np.arange(FIRST, (length + 1) // 2)
    lines = lines[(lines * spacing >= low) & (lines * spacing <= high)]
    if not lines.size:
        raise LabError(
            f"no line of {length} samples at {1 / dt:.6g} Hz lies between {low:g} and {high:g} Hz; "
            "widen the band or record longer"
        )
    half = np.minimum(half_bandwidth(plant, lines * spacing), SHARPEST * lines * spacing)
    widths = np.maximum(1, np.floor(WIDTH * half / spacing))
    firsts, line = [], int(lines[0])
    while line <= lines[-1]:
        firsts.append(line)
        line += int(min(widths[line - lines[0]], lines.size))
    first = np.array(firsts, dtype=np.intp)
    last = np.append(first[1:] - 1, lines[-1])
    size = last - first + 1
    spread = spacing * np.sqrt((size**2 - 1) / 12 + _window_variance(length))
    middle = spacing * (first + last) / 2
    # Near zero the two nodes may not pass it.
    return Bands(middle, np.minimum(spread, middle / 2), first, last, length, dt)


def averages(pieces: Sequence[Array], bands: Bands) -> Averages:
    """Cross-spectra of pieces (n_outputs, length) over bands.

    Source: Brillinger (1981), Time Series, sections 4.2 and 7.2.
    """
    w = taper(bands.length)
    starts = bands.first - bands.first[0]
    sums = np.zeros((len(pieces[0]), starts.size, len(pieces[0])), dtype=complex)
    lines = slice(bands.first[0], bands.last[-1] + 1)
    for piece in pieces:
        centred = piece - piece.mean(axis=1, keepdims=True)
        Y = scipy.fft.rfft(w * centred)[:, lines] / np.sqrt(np.sum(w**2))
        rows = [np.add.reduceat(Y * y.conj(), starts, axis=1) for y in Y]
        sums += np.stack(rows, axis=2)
    size = (bands.last - bands.first + 1) * len(pieces)
    values = sums.transpose(1, 0, 2) / size[:, None, None]
    return Averages(bands, values, size * _efficiency(bands.length))


def piece_length(outputs: Sequence[Array]) -> int:
    """Length of the pieces into which records are cut: that of the stretch without missing samples that leaves least over.

    Raises:
        LabError: no stretch is long enough.
    """
    runs = [run.shape[1] for y in outputs for run in _complete(y)]
    used = {n: (n * sum(run // n for run in runs), n) for n in runs if n >= SHORTEST}
    if not used:
        raise LabError(
            f"no stretch of {SHORTEST} samples is without a missing one; fill the gaps or leave the broken channel out"
        )
    return max(used, key=lambda n: used[n])


def pieces_of(outputs: Sequence[Array], length: int) -> list[Array]:
    """Pieces of that length without a missing sample."""
    return [
        run[:, k : k + length]
        for y in outputs
        for run in _complete(y)
        for k in range(0, run.shape[1] - length + 1, length)
    ]


def taper(length: int) -> Array:
    """A window that is flat but for a cosine at either end, (length,)."""
    rise = max(int(TAPER * length), 1)
    w = np.ones(length)
    w[:rise] = np.sin(np.pi * (np.arange(rise) + 0.5) / (2 * rise)) ** 2
    w[-rise:] = w[:rise][::-1]
    return w


def _window_variance(length: int) -> float:
    """Variance of frequency under the window's power, in lines squared: ∫ w'² / (4π² ∫ w²) with time in pieces."""
    w = taper(length)
    return float(np.sum(np.diff(w) ** 2) * length**2 / (4 * np.pi**2 * np.sum(w**2)))


def _efficiency(length: int) -> float:
    """Independent lines behind each line of the window."""
    w = taper(length)
    return float(np.sum(w**2) ** 2 / (length * np.sum(w**4)))


def _complete(y: Array) -> list[Array]:
    """Stretches of a record in which no sample is missing."""
    known = np.all(np.isfinite(y), axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    return [y[:, a:b] for a, b in zip(edges[::2], edges[1::2], strict=True)]
