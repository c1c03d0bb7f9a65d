"""How far covariances must reach: as long as the slowest oscillation of the structure takes to go round once.

The shift from one block row to the next turns a pole by ω dt. A horizon much shorter than a period sees
little of that turn, and noise decides; a horizon of many periods adds lags where little is left but noise.
"""

from __future__ import annotations

import itertools

import numpy as np
import scipy.fft

from identification.recording import Array, Recording

MAX_SEGMENT = 1 << 14
MAX_SAMPLES = 1 << 17


def resonance_peaks(recording: Recording) -> list[float]:
    """Frequencies of the resonance peaks in the spectra of the outputs [Hz], rising.

    The power spectra of all outputs, each divided by its total power, are added. A peak stands out when the
    sum rises to it by a factor of four and falls from it by as much, as at a resonance with less than 25 %
    damping and hardly ever by the scatter of averaged spectra, and when it reaches a thousandth of the
    highest.

    Args:
        recording: the outputs of the first `MAX_SAMPLES` samples of each record are looked at.

    Returns:
        The top bin of each peak. Fewer than about 16 periods in a record cannot be told from drift.

    Source: Welch (1967), IEEE Trans. Audio Electroacoust. 15, for the averaged spectra.
    """
    longest = min(max(record.n_samples for record in recording.records), MAX_SAMPLES)
    length = min(1 << (longest // 8).bit_length() - 1, MAX_SEGMENT)
    if length < 32:
        return []
    with np.errstate(
        invalid="ignore", over="ignore"
    ):  # whoever needs the samples names those that are missing
        power = _relative_power(recording, length)
    found = [k for k in _peaks(power, 4.0) if k >= 2 and power[k] >= 1e-3 * np.max(power)]
    return [k * recording.sample_rate / length for k in found]


def _relative_power(recording: Recording, length: int) -> Array:
    """Sum over the outputs of averaged power spectra, each divided by its total, (length // 2 + 1,)."""
    window = np.sin(np.pi * np.arange(length) / length) ** 2
    power = np.zeros((len(recording.outputs), length // 2 + 1))
    for record in recording.records:
        before = np.empty((len(recording.outputs), 0))
        for _, half in itertools.islice(record.blocks(length // 2), 2 * MAX_SAMPLES // length):
            segment = np.hstack([before, half])
            before = half
            if segment.shape[1] == length:
                segment = segment - np.mean(segment, axis=1, keepdims=True)
                power += np.abs(scipy.fft.rfft(segment * window)) ** 2
    total = np.sum(power, axis=1, keepdims=True)
    return np.asarray(np.sum(power / np.where(total == 0, 1, total), axis=0))


def _peaks(power: Array, factor: float) -> list[int]:
    """Bins of the peaks that the spectrum climbs to, and falls from, by more than a factor."""
    found, top, bottom, climbing = [], 0, np.inf, False
    for k, value in enumerate(power.tolist()):
        if climbing:
            if value > power[top]:
                top = k
            elif value * factor < power[top]:
                found.append(top)
                bottom, climbing = value, False
        elif value > factor * bottom:
            top, climbing = k, True
        else:
            bottom = min(bottom, value)
    return found
