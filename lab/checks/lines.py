"""Lines: averaged spectra of all channels, their relation to the inputs, and how steadily mains lines turn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.fft
import scipy.signal
from numpy.typing import NDArray

from identification.recording import Array
from lab.checks.levels import Blocks

Complex = NDArray[np.complex128]

MAX_LENGTH = 8192
MAINS_HZ = (50.0, 60.0)
N_HARMONICS = 5
NEAR = 6
"""Bins on either side of a mains line that tell what is usual there."""

OFF = 3
"""Bins next to it that its own window may reach."""


@dataclass(frozen=True)
class Lines:
    """Averages over consecutive pieces of a record under a Hann window.

    Attributes:
        frequency_hz: shape (n_lines,).
        power: one-sided power spectral densities, shape (n_channels, n_lines) [unit²/Hz].
        cross: mean of X Uᴴ of all channels and the inputs, shape (n_lines, n_channels, n_inputs).
        n_pieces: pieces averaged, without those that miss a sample.
        length: samples of a piece.
        sample_rate: [Hz].
        mains: by frequency [Hz] as it appears after sampling: transforms of the pieces at the bins around it,
            shape (n_channels, n_pieces, n_bins), scaled so that a sine of amplitude one at the middle gives one.
    """

    frequency_hz: Array
    power: Array
    cross: Complex
    n_pieces: int
    length: int
    sample_rate: float
    mains: Mapping[float, Complex]

    def coherence(self) -> Array:
        """Multiple coherence of each output with the inputs, shape (n_lines, n_outputs); 0 for a silent one.

        Freed of its bias: n pieces and m inputs explain m / n of any noise. Never below zero.

        Source: Bendat and Piersol (2010), Random Data, eqs. (7.35) and (9.75).
        """
        n, m = self.n_pieces, self.cross.shape[2]
        uu, yu = self.cross[:, :m], self.cross[:, m:]
        yy = self.power[m:].T
        inverse = np.linalg.pinv(uu, rcond=1e-10, hermitian=True)
        told = np.einsum("fyu,fuv,fyv->fy", yu, inverse, yu.conj()).real
        share = np.divide(told, yy, out=np.zeros(yy.shape), where=yy > 0)
        return np.asarray(np.maximum(1 - (1 - share) * n / max(n - m, 1), 0.0))


def piece_length(n_samples: int) -> int:
    """Samples of a piece: a power of two, for sixteen pieces or more in a record of fair length."""
    return int(min(max(1 << max(n_samples // 16, 1).bit_length() - 1, 32), MAX_LENGTH))


def folded(frequency_hz: float, sample_rate: float) -> float:
    """Where a frequency appears after sampling without a filter [Hz]."""
    return abs(frequency_hz - sample_rate * round(frequency_hz / sample_rate))


def lines_of(blocks: Blocks, n_samples: int, n_channels: int, n_inputs: int, sample_rate: float) -> Lines:
    """Lines of one record.

    Source: Welch (1967), IEEE Trans. Audio Electroacoust. 15(2).
    """
    n = piece_length(n_samples)
    window = scipy.signal.windows.hann(n, sym=False)
    f = np.arange(n // 2 + 1) * sample_rate / n
    bins = _mains_bins(n, sample_rate)
    power = np.zeros((n_channels, f.size))
    cross = np.zeros((f.size, n_channels, n_inputs), complex)
    kept: dict[float, list[Complex]] = {line: [] for line in bins}
    n_pieces = 0
    for x in blocks(multiple=n):
        pieces = x[:, : x.shape[1] // n * n].reshape(n_channels, -1, n)
        pieces = pieces[:, np.isfinite(pieces.sum(axis=(0, 2)))]
        if not pieces.shape[1]:
            continue
        X = scipy.fft.rfft((pieces - pieces.mean(axis=2, keepdims=True)) * window)
        power += np.einsum("ijk,ijk->ik", X.real, X.real) + np.einsum("ijk,ijk->ik", X.imag, X.imag)
        if n_inputs:
            by_line = X.transpose(2, 0, 1)  # (n_lines, n_channels, n_pieces)
            cross += by_line @ by_line[:, :n_inputs].conj().transpose(0, 2, 1)
        for line, near in bins.items():
            kept[line].append(X[:, :, near] * (2 / window.sum()))
        n_pieces += pieces.shape[1]
    scale = 2 / (max(n_pieces, 1) * sample_rate * np.sum(window**2))
    mains = {
        line: np.concatenate(found, axis=1) if found else np.zeros((n_channels, 0, 2 * NEAR + 1), complex)
        for line, found in kept.items()
    }
    return Lines(f, power * scale, cross * scale, n_pieces, n, sample_rate, mains)


def _mains_bins(n: int, sample_rate: float) -> dict[float, NDArray[np.int64]]:
    """Bins around every mains line and harmonic that can be told from its neighbours."""
    found = {}
    for mains in MAINS_HZ:
        for harmonic in range(1, N_HARMONICS + 1):
            line = harmonic * mains
            middle = round(folded(line, sample_rate) * n / sample_rate)
            if NEAR < middle < n // 2 - NEAR and line < 2 * sample_rate:
                found[line] = np.arange(middle - NEAR, middle + NEAR + 1)
    return found
