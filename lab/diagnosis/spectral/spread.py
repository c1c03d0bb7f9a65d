"""Spread: how errors of frequency responses of unknown variance spread over their lines."""

from __future__ import annotations

import numpy as np

from identification.recording import Array
from lab.diagnosis.spectral.transfer import Complex

FLOORS = np.geomspace(1e-4, 10.0, 26)
"""Levels of even noise that are compared, over the RMS response; the last is as good as even."""


def noise_floors(values: Complex, error: Complex) -> Array:
    """Size of each response up to which errors are even, and beyond which they grow with it, (n_outputs, n_inputs).

    Noise of a recorder is the same on all lines; errors of a model, of averaging and of leakage grow with the response. The
    likeliest sum of both is taken, unless errors even at any size are as likely but for the price of the one number that
    they save (Schwarz 1978); these have no such floor, which is infinite.

    Args:
        values: measured responses, (n_f, n_outputs, n_inputs).
        error: of a fit, likewise.

    Source: Pintelon and Schoukens (2012), System Identification, 2nd ed., section 9.2, the variance unknown.
    """
    n, found = len(values), np.full(values.shape[1:], np.inf)
    for pair in np.ndindex(found.shape):
        size, e = np.abs(values[:, *pair]), np.abs(error[:, *pair])
        rms = np.sqrt(np.mean(size**2))
        if not (rms and np.any(e)):
            continue
        shapes = np.sqrt(1 + (size / (rms * FLOORS[:, None])) ** 2)
        costs = 4 * np.sum(np.log(shapes), axis=1) + 2 * n * np.log(np.mean((e / shapes) ** 2, axis=1))
        best = int(np.argmin(costs))
        if costs[best] < 2 * n * np.log(np.mean(e**2)) - np.log(n):
            found[pair] = rms * FLOORS[best]
    return found


def spread_of(values: Complex, floors: Array) -> Array:
    """What the standard deviation of every value is proportional to, one for small responses, shape of the values."""
    return np.sqrt(1 + (np.abs(values) / floors) ** 2)
