"""Whether what a model leaves unexplained is noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.fft
import scipy.special

from identification.recording import Array


def autocorrelation(residual: Array, n_lags: int) -> Array:
    """Correlation of each row with itself 1, 2, … samples later, shape (n_rows, n_lags).

    Args:
        residual: shape (n_rows, n_samples).
        n_lags: largest lag.

    Returns:
        Numbers from -1 to 1; zero for a row of zeros.

    Source: Ljung and Box (1978), Biometrika 65(2), the residual autocorrelations of section 1.
    """
    n_samples = residual.shape[1]
    size = scipy.fft.next_fast_len(n_samples + n_lags, real=True)
    spectrum = scipy.fft.rfft(residual, size)
    products = scipy.fft.irfft(np.abs(spectrum) ** 2, size)[:, : n_lags + 1]
    power = products[:, :1]
    return np.asarray(products[:, 1:] / np.where(power > 0, power, 1))


def whiteness(residuals: Sequence[Array], *, n_lags: int = 20) -> Array:
    """Probability that white noise looks at least as correlated as each row, shape (n_outputs,).

    Near zero: the model misses something that lasts from sample to sample. Uniform between 0 and 1 where the
    model is right and the records are long against `n_lags`.

    Args:
        residuals: one array per record, shape (n_outputs, n_samples); NaN where a sample is missing.
        n_lags: number of lags looked at, lowered where a record is shorter than five times as many samples.

    Returns:
        Numbers from 0 to 1.

    Source: Ljung and Box (1978), Biometrika 65(2), statistic Q̃, summed over the records; where samples are missing
        each lag counts by the pairs that are left, as in Dunsmuir and Robinson (1981), J. Am. Stat. Assoc. 76, 560-568.
    """
    statistic, freedom = np.zeros(len(residuals[0])), 0
    for residual in residuals:
        n_samples = residual.shape[1]
        lags = np.arange(1, 1 + min(n_lags, n_samples // 5))
        known = np.isfinite(residual)
        n_known = np.sum(known, axis=1, keepdims=True)
        pairs = np.maximum(autocorrelation(known, lags.size) * n_known, 1)
        r = autocorrelation(np.where(known, residual, 0), lags.size)
        statistic += np.sum(n_known * (n_known + 2) * r**2 / pairs, axis=1)
        freedom += lags.size
    return np.asarray(scipy.special.chdtrc(max(freedom, 1), statistic))
