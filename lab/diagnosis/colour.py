"""Colour: how many samples of a residual that is not white weigh as much as one of a white one."""

from __future__ import annotations

import numpy as np

from identification.recording import Array

LAGS = 5.0
"""Lags to sum over, in units of the sum (Sokal 1997, Monte Carlo methods in statistical mechanics, section 3)."""


def colour(residual: Array) -> float:
    """Samples of a residual (n_outputs, n) that count as one; 1 where it is white.

    An error of the model stays alike for a while, and so do the slopes that a fit holds against it: the product of two
    signals with autocorrelation ρ sums up as if only n / Σ ρ_k² of its samples were independent. The most coloured channel
    counts.

    Source: Bartlett (1946), J. R. Stat. Soc. Suppl. 8, 27-41, for the sum over all lags.
    """
    n = residual.shape[1]
    e = residual - residual.mean(axis=1, keepdims=True)
    power = np.abs(np.fft.rfft(e, 2 * n, axis=1)) ** 2
    covariance = np.fft.irfft(power, 2 * n, axis=1)[:, : n // 2]
    rho = covariance / np.maximum(covariance[:, :1], 1e-300)
    # Of white noise ρ_k² is (n - k) / n² on average, which is no colour.
    lags = np.arange(1, rho.shape[1])
    sums = 1 + 2 * np.cumsum(rho[:, 1:] ** 2 - (n - lags) / n**2, axis=1)
    # Beyond a few times the sum itself there is nothing but scatter.
    ends = [int(np.argmax(done)) if np.any(done) else -1 for done in lags >= LAGS * sums]
    return float(np.clip(max(row[end] for row, end in zip(sums, ends, strict=True)), 1.0, n / 4))
