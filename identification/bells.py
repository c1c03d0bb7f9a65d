"""Bells: the stretch of a spectrum around a peak that belongs to one mode, and the pole behind it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.peaks import find_peaks
from identification.recording import Array, frozen

Complex = NDArray[np.complex128]

FIT_FROM, FIT_TO = 0.9, 0.2
"""Share of its height between which the decay of a correlation is fitted."""

MIN_WINDOW = 0.1
"""Least share that the window of the pieces leaves of a correlation that is used."""


@dataclass(frozen=True, eq=False, repr=False)
class Bell:
    """The stretch of the spectrum around a peak that belongs to one mode.

    Attributes:
        peak: line of the peak.
        lines: first line, and the one behind the last.
        power: spectrum of what the shape of the mode lets through, φᴴ G φ, at each line [unit² / Hz].
        shape: φ, mean of the singular vectors that resemble the one at the peak, of length one, shape (n_outputs,).
        prominence: power of the peak over the power at the higher end.
    """

    peak: int
    lines: tuple[int, int]
    power: Array
    shape: Complex
    prominence: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "power", frozen(self.power))


def find_bells(S: Array, U: Complex, *, factor: float, min_mac: float) -> list[Bell]:
    """One bell for each peak of the singular values that keeps its shape on both sides, by rising line.

    Where two modes cross, the second singular value has a cusp whose shape changes from one side to the
    other; noise has a shape of its own at every line. Neither falls to half its height in one shape.

    Args:
        S: singular values of the spectral matrix, largest first, shape (n_lines, n_outputs).
        U: their vectors in columns, shape (n_lines, n_outputs, n_outputs).
        factor: by which a peak must stand out.
        min_mac: least resemblance of the shape at a line with that of the peak.

    Returns:
        The bells, one per mode.

    Source: Brincker, Ventura and Andersen (2001), Proc. 19th IMAC, for the lines of one shape; Zhang, Wang
        and Tamura (2010), Mech. Syst. Signal Process. 24, 1227-1239, for the spectrum φᴴ G φ.
    """
    bells: list[Bell] = []
    for rank in range(min(2, S.shape[1])):
        for peak in find_peaks(S[:, rank], factor):
            found = _shape(S, U, peak.top, rank, factor, min_mac)
            if found is None:
                continue
            bell = _bell(S, U, found, factor)
            if not any(_same(bell, other, min_mac) for other in bells):
                bells.append(bell)
    return sorted(bells, key=lambda bell: bell.peak)


class _Shape(NamedTuple):
    """A shape and the lines, last one included, at which it holds."""

    shape: Complex
    first: int
    last: int


def _shape(S: Array, U: Complex, peak: int, rank: int, factor: float, min_mac: float) -> _Shape | None:
    """The shape at a peak; None unless the power in that shape falls to half on both sides."""
    alike = np.abs(np.einsum("o,foi->fi", U[peak, :, rank].conj(), U)) ** 2  # (n_lines, n_outputs)
    own = np.argmax(alike, axis=1)
    power, resemblance = (np.take_along_axis(X, own[:, None], axis=1)[:, 0] for X in (S, alike))
    first, last = _feet(np.where(resemblance >= min_mac, power, np.inf), peak, factor)
    if max(power[first], power[last]) > power[peak] / 2:
        return None
    lines = np.arange(first, last + 1)
    vectors = U[lines, :, own[lines]]
    # Each vector has a phase of its own, which its projector has not.
    mean = np.einsum("f,fi,fj->ij", power[lines], vectors, vectors.conj())
    return _Shape(np.linalg.eigh(mean)[1][:, -1], first, last)


def _bell(S: Array, U: Complex, found: _Shape, factor: float) -> Bell:
    power = np.sum(S * np.abs(np.einsum("o,foi->fi", found.shape.conj(), U)) ** 2, axis=1)  # φᴴ G φ
    peak = found.first + int(np.argmax(power[found.first : found.last + 1]))
    first, last = _feet(power, peak, factor)
    foot = max(power[first], power[last], np.finfo(float).tiny)
    return Bell(peak, (first, last + 1), power[first : last + 1], found.shape, float(power[peak] / foot))


def _feet(power: Array, peak: int, factor: float) -> tuple[int, int]:
    """The lowest lines on both sides of a peak before the power climbs again by the factor, or above the peak."""
    feet = []
    for side in (range(peak, -1, -1), range(peak, power.size)):
        lowest = peak
        for k in side:
            if power[k] > min(factor * power[lowest], power[peak]):
                break
            if power[k] < power[lowest]:
                lowest = k
        feet.append(lowest)
    return feet[0], feet[1]


def _same(a: Bell, b: Bell, min_mac: float) -> bool:
    """Whether two bells are one: either peak lies within the other bell, and the shapes are alike."""
    within = b.lines[0] <= a.peak < b.lines[1] or a.lines[0] <= b.peak < a.lines[1]
    return within and bool(abs(np.vdot(a.shape, b.shape)) ** 2 >= min_mac)


def bell_pole(bell: Bell, n_transform: int, dt: float, lag_window: Array) -> complex:
    """Pole of the oscillator whose spectrum the bell is [rad/s], by the decrement of its correlation.

    The inverse transform of the bell, on positive frequencies alone, is the correlation as a complex
    signal: its logarithm is a straight line, whose slope is the pole. The window of the pieces has
    multiplied the correlation and is divided out. Lags shorter than one over the width of the bell, where
    the cut tails of the bell show, are left out, and so are those late ones that are mostly scatter.

    What bias is left comes from the tails that are cut off the bell: of the damping, about the share of the
    power that they hold.

    Args:
        bell: on lines of a zero-padded transform.
        n_transform: length of that transform, twice that of a piece.
        dt: sample time [s].
        lag_window: as of `CrossSpectra.lag_window`.

    Returns:
        A complex number with a positive imaginary part.

    Source: Brincker, Ventura and Andersen (2001), Proc. 19th IMAC, damping estimation by frequency domain
        decomposition; the window as in Jacobsen, Andersen and Brincker (2008), Proc. 26th IMAC.
    """
    spectrum = np.zeros(n_transform, complex)
    spectrum[slice(*bell.lines)] = bell.power
    n_lags = int(np.argmax(lag_window < MIN_WINDOW)) or lag_window.size
    r = np.fft.ifft(spectrum)[:n_lags] / lag_window[:n_lags]
    height = np.abs(r) / np.abs(r[0])
    first = max(n_transform // (bell.lines[1] - bell.lines[0]), _first_below(height, FIT_FROM))
    last = _first_below(height, FIT_TO)
    if last - first < 3:
        first, last = 0, min(max(last, 3), n_lags)
    k = np.arange(first, last)
    log = np.log(height[k]) + 1j * np.unwrap(np.angle(r[k]))
    return complex(np.polyfit(k * dt, log, 1)[0])


def _first_below(height: Array, level: float) -> int:
    below = np.flatnonzero(height < level)
    return int(below[0]) if below.size else height.size
