"""The sample rate of a column of time, and whether the column is even enough to have one."""

from __future__ import annotations

import numpy as np

from identification.recording import Array
from lab.errors import FileError

EVEN = 0.01
"""Largest departure from even sampling that lets a column of time speak for itself [samples]."""

ROUNDED = 0.6
"""Largest departure where the rate is stated: half a sample is what rounding makes of a true one [samples]."""

AGREE = 1e-5
"""Relative difference between a stated rate and one from a file that writes six digits."""


def even_rate(time: Array) -> float:
    """Sample rate of an even column of time [Hz].

    Args:
        time: shape (n_samples,) [s].

    Raises:
        FileError: fewer than two samples, a missing one, or uneven steps.
    """
    if time.size < 2 or not np.isfinite(time).all():
        raise FileError(
            f"time has {np.isfinite(time).sum()} of {time.size} samples; expected two or more, complete"
        )
    span = float(time[-1] - time[0])
    if span <= 0:
        raise FileError(f"time runs from {time[0]:g} s to {time[-1]:g} s; expected it to rise")
    rate = (time.size - 1) / span
    worst, where = departure(time, rate)
    if worst > EVEN:
        raise FileError(
            f"time is uneven: sample {where} lies {worst:.2g} samples from an even step of {1 / rate:.6g} s; "
            "resample it, or state sample_rate where only rounding is to blame"
        )
    return rate


def check_time(time: Array, rate: float) -> None:
    """Makes sure that a column of time [s] fits a stated rate [Hz], up to rounding.

    Raises:
        FileError: a sample lies elsewhere.
    """
    worst, where = departure(time, rate)
    if not worst <= ROUNDED:
        raise FileError(
            f"time at sample {where} is {worst:.3g} samples from where the stated {rate:g} Hz puts it; "
            "correct sample_rate, or leave time out"
        )


def departure(time: Array, rate: float) -> tuple[float, int]:
    """Largest distance from even sampling, in samples, and where it is."""
    if not time.size:
        return 0.0, 0
    distance = np.abs((time - time[0]) * rate - np.arange(time.size))
    where = int(np.argmax(np.nan_to_num(distance, nan=np.inf)))
    return float(distance[where]), where
