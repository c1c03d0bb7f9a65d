"""How records are cut into the pieces that are transformed: so that nothing leaks where that can be had.

A rectangular window is exact for a response that begins and ends at rest, and for whole periods in the
steady state. Anything else is cut into overlapping pieces under a Hann window, whose leakage falls with the
square of the length of a piece.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from identification.errors import IdentificationError, TooShortError
from identification.recording import Array, Record, Recording

Complex = NDArray[np.complex128]

TRANSIENT = ("pulse", "impact", "burst_random", "sweep", "free_decay")
"""Kinds of records that begin at rest, or with a release, and ring down before they end."""

MAX_VALUES = 1 << 23
"""Values that the spectra of all pairs of channels may hold together."""

BATCH = 1 << 21
"""Samples transformed at a time."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Where the pieces start and what they are multiplied by.

    Attributes:
        length: samples of a piece; a record that ends earlier is followed by zeros.
        starts: first samples of the pieces, for each record.
        window: weight of each sample of a piece, shape (length,).
        kind: "transient", "periodic" or "stationary".
        n_averages: number of independent pieces that would scatter as little.
        decay: rate of the exponential window [1/s]; 0 for none.
        notes: what was chosen and why, one sentence each.
    """

    length: int
    starts: tuple[tuple[int, ...], ...]
    window: Array
    kind: str
    n_averages: float
    decay: float = 0.0
    notes: tuple[str, ...] = ()


def choose_segments(recording: Recording, *, n_segment: int | None = None, decay: float = 0.0) -> Segments:
    """The pieces that suit the kinds of the records.

    Whole records where all are transient, whole periods in the steady state where all are periodic, and
    half-overlapping pieces under a Hann window otherwise. Transient and periodic records tell the
    responses to several inputs apart only where there are as many records as inputs.

    Args:
        recording: at least one record.
        n_segment: samples of a piece; asks for pieces under a Hann window, whatever the kinds.
        decay: rate of an exponential window for transient records [1/s].

    Returns:
        Where the pieces are, how they are weighted, and why.

    Raises:
        TooShortError: no record is as long as `n_segment`.
        IdentificationError: an exponential window for records that are not transient.
    """
    kinds = {record.kind for record in recording.records}
    enough = len(recording.records) >= len(recording.inputs)
    notes: tuple[str, ...] = ()
    if kinds <= set(TRANSIENT) and enough and n_segment is None:
        return _whole_records(recording, decay)
    if decay:
        raise IdentificationError(
            f"an exponential window suits transient records ({', '.join(TRANSIENT)}), one per input at least; "
            f"these are {len(recording.records)} of kind {', '.join(sorted(kinds))} for "
            f"{len(recording.inputs)} inputs; leave `decay` at 0"
        )
    if kinds == {"multisine"} and n_segment is None:
        periods = {find_period(record) for record in recording.records}
        if len(periods) == 1 and enough and (period := periods.pop()):
            return _whole_periods(recording, period)
        notes = ("The records do not repeat, or differ in period, and are treated as random.",)
    if not enough and n_segment is None and kinds <= {*TRANSIENT, "multisine"}:
        notes = (
            f"{len(recording.records)} records do not tell {len(recording.inputs)} inputs apart line by line, so "
            "they are treated as random; record as many as there are inputs.",
        )
    # Leakage is an error that no average removes, so that few averages of long pieces are best.
    found = hann_segments(recording, n_segment, n_averages=max(8, 3 * len(recording.inputs)))
    return replace(found, notes=(*notes, *found.notes))


def hann_segments(recording: Recording, n_segment: int | None, *, n_averages: int) -> Segments:
    """Half-overlapping pieces under a periodic Hann window, about `n_averages` when their length is None.

    Args:
        recording: at least one record.
        n_segment: samples of a piece; None to choose.
        n_averages: how many pieces to aim at.

    Returns:
        Where the pieces are, and how they are weighted.

    Raises:
        TooShortError: no record is as long as `n_segment`, or it is below 8.

    Source: Welch (1967), IEEE Trans. Audio Electroacoust. 15(2), the variance of overlapped averages.
    """
    longest = max(record.n_samples for record in recording.records)
    notes: tuple[str, ...] = ()
    if n_segment is None:
        largest = 2 * MAX_VALUES // len(recording.outputs) ** 2
        wanted = max(min(2 * recording.n_samples // (n_averages + 1), longest, largest), 8)
        n_segment = int(scipy.fft.prev_fast_len(wanted // 2, real=True)) * 2
        notes = (f"Pieces of {n_segment} samples under a Hann window give at least {n_averages} averages.",)
    if not 8 <= n_segment <= longest:
        raise TooShortError(
            f"pieces of {n_segment} samples were asked for and the longest record has {longest}; "
            "expected at least 8 and no more than that"
        )
    step = n_segment // 2
    starts = tuple(tuple(range(0, record.n_samples - n_segment + 1, step)) for record in recording.records)
    window = np.sin(np.pi * np.arange(n_segment) / n_segment) ** 2
    # Pieces that overlap by half are correlated by 1/6, which counts squared.
    shared = (np.sum(window[step:] * window[: n_segment - step]) / np.sum(window**2)) ** 2
    n_independent = sum(len(k) / (1 + 2 * shared * (len(k) - 1) / len(k)) for k in starts if k)
    return Segments(n_segment, starts, window, "stationary", n_independent, 0.0, notes)


def _whole_records(recording: Recording, decay: float) -> Segments:
    length = max(record.n_samples for record in recording.records)
    window = np.exp(-decay * recording.dt * np.arange(length))
    starts = ((0,),) * len(recording.records)
    return Segments(length, starts, window, "transient", float(len(starts)), decay)


def _whole_periods(recording: Recording, period: int) -> Segments:
    starts = tuple(
        tuple(range(_settled(record, period) * period, record.n_samples - period + 1, period))
        for record in recording.records
    )
    n = sum(len(each) for each in starts)
    note = f"The inputs repeat after {period} samples; {n} periods in the steady state are averaged."
    return Segments(period, starts, np.ones(period), "periodic", float(n), 0.0, (note,))


def find_period(record: Record) -> int | None:
    """Samples after which the inputs repeat, at least twice in the record; None when they do not.

    The mean squared change of the inputs over a lag, relative to their power, is near zero at the period and
    at its multiples; the smallest of these lags counts. Noise on the inputs may have a tenth of their power.

    Args:
        record: with inputs.

    Returns:
        Number of samples, or None.
    """
    n = record.n_samples
    if not record.inputs.shape[0] or n < 4:
        return None
    u = np.asarray(record.inputs[:, :], dtype=float)
    u = u - np.mean(u, axis=1, keepdims=True)
    energy = np.concatenate([[0.0], np.cumsum(np.sum(u * u, axis=0))])
    if energy[-1] == 0:
        return None
    length = scipy.fft.next_fast_len(2 * n, real=True)
    product = np.sum(scipy.fft.irfft(np.abs(scipy.fft.rfft(u, length)) ** 2, length), axis=0)
    lag = np.arange(n // 2 + 1)
    power = energy[n - lag] + energy[-1] - energy[lag]
    change = 1 - 2 * product[lag] / np.where(power > 0, power, 1)
    apart = np.flatnonzero(change > 0.5)  # a slow signal hardly changes from sample to sample
    if not apart.size:
        return None
    change[: apart[0]] = 1
    best = float(np.min(change))
    if best > 0.1:
        return None
    return int(np.flatnonzero(change <= 2 * max(best, 0) + 1e-12)[0])


def _settled(record: Record, period: int) -> int:
    """Periods to leave out: the first, and all until one is as near to the last as the last but one is."""
    n = record.n_samples // period
    last = np.asarray(record.outputs[:, (n - 1) * period : n * period], dtype=float)
    scale = np.sqrt(np.mean(last**2, axis=1, keepdims=True))
    scale[scale == 0] = 1
    distance = [
        float(np.linalg.norm((record.outputs[:, m * period : (m + 1) * period] - last) / scale))
        for m in range(1, n - 1)
    ]
    near = [m for m, d in enumerate(distance, start=1) if d <= 2 * distance[-1] + 1e-15]
    return near[0] if near else 1


def transforms(
    recording: Recording, segments: Segments, *, inputs: bool, n_transform: int | None = None
) -> Iterator[Complex]:
    """Fourier transforms of the pieces, a batch at a time.

    Args:
        recording: read piece by piece.
        segments: where the pieces are.
        inputs: whether the inputs come along, ahead of the outputs.
        n_transform: length of the transform; that of a piece when None.

    Yields:
        Shape (n_frequencies, n_channels, n_pieces).
    """
    n_channels = len(recording.outputs) + inputs * len(recording.inputs)
    size = max(BATCH // (n_channels * segments.length), 1)
    for record, starts in zip(recording.records, segments.starts, strict=True):
        for k in range(0, len(starts), size):
            pieces = _pieces(record, starts[k : k + size], segments.length, inputs)
            if segments.kind == "stationary":
                pieces -= np.mean(pieces, axis=2, keepdims=True)
            X = scipy.fft.rfft(pieces * segments.window, n_transform)
            yield np.ascontiguousarray(X.transpose(2, 0, 1))


def _pieces(record: Record, starts: tuple[int, ...], length: int, inputs: bool) -> Array:
    """Pieces of a record, shape (n_channels, n_pieces, length)."""
    first, last = starts[0], starts[-1] + length
    sides = (record.inputs, record.outputs) if inputs else (record.outputs,)
    signals = np.vstack([np.asarray(side[:, first:last], dtype=float) for side in sides])
    signals = np.pad(signals, ((0, 0), (0, last - first - signals.shape[1])))
    return np.stack([signals[:, start - first : start - first + length] for start in starts], axis=1)
