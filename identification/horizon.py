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


def lowest_peak(recording: Recording) -> float | None:
    """Frequency of the lowest resonance peak in the spectra of the outputs [Hz]; None when none stands out.

    The power spectra of all outputs, each divided by its total power, are added. A peak stands out when the
    sum falls to a quarter of it on both sides before rising above it again, as a resonance with less than
    25 % damping does and the scatter of averaged spectra hardly ever, and when it reaches a thousandth of
    the highest.

    Args:
        recording: the outputs of the first `MAX_SAMPLES` samples of each record are looked at.

    Returns:
        The frequency of the top bin. Fewer than about 16 periods in a record cannot be told from drift.

    Source: Welch (1967), IEEE Trans. Audio Electroacoust. 15, for the averaged spectra.
    """
    longest = min(max(record.n_samples for record in recording.records), MAX_SAMPLES)
    length = min(1 << (longest // 8).bit_length() - 1, MAX_SEGMENT)
    if length < 32 or length > longest:
        return None
    power = _relative_power(recording, length)
    tops = (power[1:-1] >= power[:-2]) & (power[1:-1] >= power[2:]) & (power[1:-1] >= 1e-3 * np.max(power))
    for k in (np.flatnonzero(tops) + 1).tolist():
        if k >= 2 and _stands_out(power, k):
            return float(k * recording.sample_rate / length)
    return None


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


def _stands_out(power: Array, k: int) -> bool:
    """Whether the spectrum falls from bin k to a quarter on both sides before it rises above it again."""
    valleys = []
    for side in (power[k - 1 :: -1], power[k + 1 :]):
        higher = np.flatnonzero(side > power[k])
        valleys.append(np.min(side[: higher[0]] if higher.size else side))
    return bool(power[k] >= 4 * max(valleys))
