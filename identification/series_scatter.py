"""How far the mean of a correlated series may be from its expectation."""

from __future__ import annotations

import numpy as np
import scipy.fft

from identification.errors import TooShortError
from identification.recording import Array

FEWEST, MOST = 8, 40
"""Cosines: fewer leave the scatter itself unknown, more add little."""


def std_of_sum(series: Array, memory: float) -> Array:
    """One standard deviation of the sum of each stationary series, however its samples are correlated.

    The projections on cosines that turn slowly against the memory of the series, but do turn, have the
    variance of the mean and no mean of their own.

    Args:
        series: shape (…, n_samples).
        memory: samples over which the series is correlated.

    Returns:
        Shape (…).

    Raises:
        TooShortError: the series is not many times longer than its memory.

    Source: Müller (2007), J. Econometrics 141, eq. (10) with equal weights; Lazarus, Lewis, Stock and
        Watson (2018), J. Bus. Econ. Stat. 36(4), the equal-weighted cosine estimator.
    """
    n = series.shape[-1]
    n_cosines = min(MOST, int(n / (2 * max(memory, 1.0))), n - 1)
    if n_cosines < FEWEST:
        raise TooShortError(
            f"{n} samples with a memory of {memory:.0f} are too few to see how their mean scatters; record for longer"
        )
    waves = scipy.fft.dct(series, norm="ortho", axis=-1)[..., 1 : n_cosines + 1]
    return np.asarray(np.sqrt(n * np.mean(waves**2, axis=-1)))
