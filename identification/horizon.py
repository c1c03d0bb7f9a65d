"""How far covariances must reach and how many modes to look for, as the spectra of the outputs show.

The shift from one block row to the next turns a pole by ω dt. A horizon much shorter than a period sees
little of that turn, and noise decides; a longer one adds lags where the fast modes have died out and only
their noise is left. Trials with chains of one to seven sensors and with a measured tower did best between
half a period and a whole one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import scipy.fft

from identification.recording import Array, Recording

MAX_SEGMENT = 1 << 14
MAX_SAMPLES = 1 << 17
"""Samples of a record that the search for peaks looks at, and the longest segment of its spectra."""

MAX_ORDER = 100
MAX_COLUMNS = 1500
MAX_VALUES = 1 << 24
"""Bounds on the sweep and on the Hankel matrix, which keep the work in seconds and in 128 MiB."""


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
    longest = max(record.n_samples for record in recording.records)
    if longest < 256:
        return []
    length = min(1 << (min(longest, MAX_SAMPLES) // 8).bit_length() - 1, MAX_SEGMENT)
    # Whoever needs the samples names those that are missing.
    with np.errstate(invalid="ignore", over="ignore"):
        power = _relative_power(recording, length)
    found = [k for k in _peaks(power, 4.0) if k >= 2 and power[k] >= 1e-3 * np.max(power)]
    return [k * recording.sample_rate / length for k in found]


def choose_orders(recording: Recording, n_peaks: int) -> tuple[list[int], str]:
    """Orders to sweep, for three times as many modes as there are resonance peaks, and the reason.

    Peaks hide modes that are close, heavily damped or weakly driven, which the factor allows for. Much
    higher orders than needed only split the modes of the structure and multiply those of the noise.

    Args:
        recording: bounds the orders by its length.
        n_peaks: how many peaks the spectra show.

    Returns:
        2, 4, … and one sentence.
    """
    highest = min(max(6 * n_peaks, 20), MAX_ORDER)
    affordable = max(recording.n_samples // 20 * 2, 2)
    if affordable < highest:
        return list(range(2, affordable + 1, 2)), f"Orders go up to {affordable}, one state per ten samples."
    return list(range(2, highest + 1, 2)), (
        f"Orders go up to {highest}, as the spectra show {n_peaks} resonance peaks "
        f"and three times as many modes are allowed for (at least 10, at most {MAX_ORDER // 2})."
    )


def choose_rows(
    recording: Recording, peaks: Sequence[float], order: int, n_references: int
) -> tuple[int, str]:
    """Block rows for the slowest oscillation, the highest order and the length of the record, and the reason.

    Args:
        recording: bounds the rows by its length, since covariances at lags near it are mostly noise.
        peaks: frequencies of the resonance peaks [Hz], rising.
        order: the highest to be realized.
        n_references: outputs in a block column.

    Returns:
        The number of block rows and one sentence.

    Source: Reynders and De Roeck (2008), Mech. Syst. Signal Process. 22(3), who ask for half a period of the
        lowest mode at least; two thirds did best in the trials above.
    """
    longest = max(record.n_samples for record in recording.records)
    span = math.ceil(2 / 3 * recording.sample_rate / peaks[0]) if peaks else 0
    for_order = 2 + -(-3 * order // (2 * n_references))
    limit = max(min(longest // 4, MAX_VALUES // (MAX_COLUMNS * len(recording.outputs))), 2)
    if limit < max(span, for_order):
        n_rows, why = limit, "the most that the length of the record or the memory allows"
    elif span >= for_order:
        n_rows, why = span, f"two thirds of a period of the lowest resonance peak, at {peaks[0]:.4g} Hz"
    else:
        n_rows, why = for_order, f"one and a half times as many as order {order} needs"
    return n_rows, f"The horizon is {n_rows} block rows, {why}."


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
