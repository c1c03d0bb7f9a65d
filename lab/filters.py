"""Analog low-pass filters of signals and forces, exact for what runs in straight lines or is held between instants.

Each pole is one recursion, so that a filter of any order and any corner goes from instant to instant without a step of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from identification.recording import Array


class _Recursion:
    """z(k+1) = exp(p h) z(k) + w(k) for one pole, over consecutive blocks; gives z(k), from z(0) = 0."""

    def __init__(self, growth: complex) -> None:
        self.growth, self.memory = growth, np.zeros(1, dtype=complex)

    def __call__(self, w: Array) -> Array:
        from scipy.signal import lfilter  # slow to load, and only filtered signals need it

        z, self.memory = lfilter([0.0, 1.0], [1.0, -self.growth], w, zi=self.memory)
        return np.asarray(z)


def low_pass(corner_hz: float, order: int, dt: float) -> Callable[[Array], Array]:
    """Analog Butterworth low-pass of a sensor's signal, exact for straight lines between substeps.

    The signal is at the end of the substep before and at the start of the one after each instant, since it may jump.
    """
    poles, residues = _butterworth(corner_hz, order)
    one, two = _phi(poles * dt)
    recursions = [_Recursion(growth) for growth in np.exp(poles * dt)]
    last, rest = 0.0, np.nan

    def process(x: Array) -> Array:
        nonlocal last, rest
        if np.isnan(rest):
            # The filter has settled on what it saw before the record.
            rest = float(x[0, 0])
        before, after = x[:2] - rest
        # The line that ends at an instant starts just after the instant before it.
        start, last = np.concatenate([[last], after[:-1]]), float(after[-1])
        y = np.full(before.size, rest)
        for i, recursion in enumerate(recursions):
            w = dt * ((one[i] - two[i]) * start + two[i] * before)
            # The line ends at this instant, so this instant's state holds it already.
            z = recursion(w)
            y += (residues[i] * (recursion.growth * z + w)).real
        return np.stack([y, y, y])

    return process


def held_low_pass(corner_hz: float, order: int, dt: float) -> Callable[[Array], Array]:
    """Analog Butterworth low-pass of a force that is held over each substep at its mean: exact for a held force."""
    poles, residues = _butterworth(corner_hz, order)
    one, two = _phi(poles * dt)
    recursions = [_Recursion(growth) for growth in np.exp(poles * dt)]

    def process(x: Array) -> Array:
        y, u = np.zeros_like(x), x[1]
        for i, recursion in enumerate(recursions):
            w = dt * one[i] * u
            z = recursion(w)
            for row, value in enumerate((z, one[i] * z + dt * two[i] * u, recursion.growth * z + w)):
                y[row] += (residues[i] * value).real
        return y

    return process


def _butterworth(corner_hz: float, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Poles [rad/s] in the upper half plane and residues of the analog filter, doubled where the conjugate is left out."""
    from scipy.signal import butter  # slow to load, and only filtered signals need it

    _, poles, gain = butter(order, 2 * np.pi * corner_hz, analog=True, output="zpk")
    apart = poles[:, None] - poles[None, :] + np.eye(order)
    residues = gain / np.prod(apart, axis=1)
    # A real pole comes with a rounded imaginary part, or none.
    real = np.abs(poles.imag) < 1e-9 * np.abs(poles)
    kept = real | (poles.imag > 0)
    return poles[kept], (residues * np.where(real, 1, 2))[kept]


def _phi(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(eˣ - 1) / x and (eˣ - 1 - x) / x², by their series where the difference would cancel."""
    terms = [x**k / math.factorial(k + 2) for k in range(20)]
    two = np.where(np.abs(x) < 0.5, sum(terms), (np.exp(x) - 1 - x) / x**2)
    return 1 + x * two, two


def band_limited_lag(signal: Array, time_constant: float, dt: float) -> Array:
    """A sampled signal, followed by as much silence, behind a first-order low-pass: exact below half the sample rate.

    Whatever an ideal anti-alias filter leaves of a signal is a sum of tones, each of which the low-pass divides by
    1 + 2πi f τ.
    """
    return _every_tone(signal, dt, lambda f: 1 / (1 + 2j * np.pi * f * time_constant))


def band_limited_delay(signal: Array, delay: float, dt: float) -> Array:
    """A sampled signal, followed by as much silence, given later: exact below half the sample rate."""
    return _every_tone(signal, dt, lambda f: np.exp(-2j * np.pi * f * delay))


def _every_tone(signal: Array, dt: float, response: Callable[[Array], np.ndarray]) -> Array:
    size = 2 * signal.shape[-1]
    tones = np.fft.rfft(signal, size) * response(np.asarray(np.fft.rfftfreq(size, dt)))
    return np.asarray(np.fft.irfft(tones, size)[..., : signal.shape[-1]])
