"""Paths: what happens to a channel between structure and recording, sample by sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.recording import Array
from lab.filters import band_limited_delay, band_limited_lag

ORDER = {
    "actuators": ("held_lag", "gain", "saturation", "delay", "lag"),
    "sensors": ("lag", "delay", "gain", "hum", "saturation"),
}
"""Stages of the measurement chain that a path knows, in the order in which it applies them."""


@dataclass(frozen=True)
class Path:
    """What happens to one channel between structure and recording.

    Attributes:
        gain: factor.
        delay: [s].
        lag: time constant of a first-order lag [s]; it has a state of its own in the plant.
        held_lag: the same for an input whose lagging value is held over each sample, as a digital filter gives it [s].
        band_limited_lag: the same for a recorded channel, behind an ideal anti-alias filter [s].
        band_limited_delay: of a recorded channel behind an ideal anti-alias filter [s].
        limit: saturation either way [unit of the channel].
        hum: sines added, each (frequency [Hz], sine, cosine).
    """

    gain: float = 1.0
    delay: float = 0.0
    lag: float = 0.0
    held_lag: float = 0.0
    band_limited_lag: float = 0.0
    band_limited_delay: float = 0.0
    limit: float = float("inf")
    hum: tuple[tuple[float, float, float], ...] = ()

    def parts(self, dt: float) -> tuple[int, float]:
        """Whole samples of the delay, and the remaining part of one."""
        samples = self.delay / dt
        whole = int(np.floor(samples + 1e-9))
        part = samples - whole
        return whole, part if part > 1e-9 else 0.0


PLAIN = Path()


def _acts(path: Path) -> bool:
    """Whether a path changes anything; most are the very same plain one, which is quick to see."""
    return path is not PLAIN and path != PLAIN


def pushed(paths: Sequence[Path], inputs: Array, dt: float) -> list[Array]:
    """Forces that the actuators make of recorded inputs (n_inputs, n_samples), held over each sample.

    Where the delay has a part of a sample, the force changes within each sample: such inputs come again, behind all others,
    as they are after the change.
    """
    forces, changed = [], []
    for path, row in zip(paths, inputs, strict=True):
        if path.held_lag:
            share = -np.expm1(-dt / path.held_lag)
            # The compiler behind it is slow to load; SciPy's filters would be as slow once more.
            from lab.kernel import lagged

            row = lagged(np.ascontiguousarray(row, dtype=float), share)
        force = np.clip(path.gain * row, -path.limit, path.limit) if _acts(path) else row
        whole, part = path.parts(dt)
        forces.append(_shifted(force, whole + (part > 0)))
        if part:
            changed.append(_shifted(force, whole))
    return forces + changed


def recorded(paths: Sequence[Path], order: Sequence[int], outputs: Array, dt: float) -> Array:
    """What the recorder gets of the structure's readings (n_outputs, n_samples); `order` says which on which cable."""
    signals = outputs.copy()
    for i, path in enumerate(paths):
        if _acts(path):
            signal = path.gain * _shifted(outputs[i], _samples(path, dt)) + _hum(path, outputs.shape[1], dt)
            signals[i] = np.clip(signal, -path.limit, path.limit)
    signals = signals[list(order)] if order else signals
    for path, signal in zip(paths, signals, strict=True):
        if path.band_limited_lag:
            signal[:] = band_limited_lag(signal, path.band_limited_lag, dt)
        if path.band_limited_delay:
            signal[:] = band_limited_delay(signal, path.band_limited_delay, dt)
    return signals


def structural(paths: Sequence[Path], order: Sequence[int], recorded: Array, dt: float) -> Array:
    """What the structure's readings were, as far as a recording tells: the paths undone, NaN where they cannot be."""
    readings = np.array(recorded)
    # What has been averaged away, or comes too late, does not come back.
    lost = [i for i, path in enumerate(paths) if path.band_limited_lag or path.band_limited_delay]
    readings[lost] = np.nan
    if order:
        readings[list(order)] = recorded
    for i, path in enumerate(paths):
        if _acts(path):
            clipped = np.abs(readings[i]) >= path.limit
            gain = path.gain if abs(path.gain) > 1e-6 else np.nan
            readings[i] = np.where(clipped, np.nan, (readings[i] - _hum(path, recorded.shape[1], dt)) / gain)
            readings[i] = _shifted(readings[i], -_samples(path, dt))
    return readings


def _samples(path: Path, dt: float) -> int:
    """Samples by which a reading is moved; the plant reads early what is left of the last one."""
    whole, part = path.parts(dt)
    return whole + (part > 0)


def _hum(path: Path, n: int, dt: float) -> Array:
    signal = np.zeros(n)
    for frequency, sine, cosine in path.hum:
        phase = 2 * np.pi * frequency * np.arange(n) * dt
        signal += sine * np.sin(phase) + cosine * np.cos(phase)
    return signal


def _shifted(signal: Array, samples: int) -> Array:
    """A signal that comes whole samples later, from rest, or earlier, into the unknown."""
    n = signal.size
    if samples >= 0:
        return np.concatenate([np.zeros(min(samples, n)), signal[: max(n - samples, 0)]])
    return np.concatenate([signal[-samples:], np.full(min(-samples, n), np.nan)])
