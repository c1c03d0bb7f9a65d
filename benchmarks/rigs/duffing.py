"""The least simulation error of a mass on a cubic spring: the equation fitted to nothing else, offsets free.

The input is taken as band-limited, which a diagnosis does not do; what is left here, no parameter of this law mends.
"""

from __future__ import annotations

import numba
import numpy as np
import scipy.optimize

from identification.recording import Array

FINER = 8
"""Steps of the fourth-order scheme in a sample are half of these."""
SIZES = np.array([5e-6, 2e-4, 1.0, 4.0, 1e-3, 1e-3])
"""Of mass, damping, stiffness, cubic coefficient, and offsets of input and output."""


def between(signal: Array) -> Array:
    """A band-limited signal (n,) at `FINER` points a sample."""
    spectrum = np.zeros(signal.size * FINER // 2 + 1, dtype=complex)
    own = np.fft.rfft(signal)
    spectrum[: own.size] = own
    return np.fft.irfft(spectrum, signal.size * FINER) * FINER


@numba.njit(cache=True)
def motion(u, dt, m, c, k, k3):  # type: ignore[no-untyped-def]
    """Positions at every sample of a mass at rest, under a force at `FINER` points a sample (Runge-Kutta 4)."""
    y = np.zeros(u.size // FINER)
    h = 2 * dt / FINER
    x = v = 0.0
    for i in range(y.size):
        y[i] = x
        for j in range(i * FINER, (i + 1) * FINER, 2):
            last = u[(j + 2) % u.size]
            a1 = (u[j] - c * v - k * x - k3 * x**3) / m
            x2, v2 = x + h / 2 * v, v + h / 2 * a1
            a2 = (u[j + 1] - c * v2 - k * x2 - k3 * x2**3) / m
            x3, v3 = x + h / 2 * v2, v + h / 2 * a2
            a3 = (u[j + 1] - c * v3 - k * x3 - k3 * x3**3) / m
            x4, v4 = x + h * v3, v + h * a3
            a4 = (last - c * v4 - k * x4 - k3 * x4**3) / m
            x += h / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return y


def simulated(parameters: Array, u: Array, dt: float) -> Array:
    """The output (n,) at parameters in units of `SIZES`, of an input at `FINER` points a sample."""
    *law, before, after = parameters * SIZES
    return np.asarray(motion(u + before, dt, *law) + after)


def fitted(u: Array, y: Array, dt: float, *, skip: int) -> Array:
    """Parameters of least simulation error, in units of `SIZES`, the first samples left out."""
    found = scipy.optimize.least_squares(
        lambda p: 1e3 * (simulated(p, u, dt) - y)[skip:], [1.0, 1.0, 1.0, 1.0, 0.0, 0.0]
    )
    return np.asarray(found.x)
