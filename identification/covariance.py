"""Covariances between outputs at different times: all that a stationary random response tells.

Under white excitation the covariances R_k = E[y_{j+k} y_jᵀ] obey R_k = C A^{k-1} G for k >= 1, like the
pulse responses of a system with the structure's own poles and shapes. Lag zero does not: it carries the
variance of the measurement noise, and is therefore left out unless asked for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from identification.errors import IdentificationError, RecordingError, TooShortError
from identification.recording import Array, Record, Recording

SEGMENTS = 8
"""Segments transformed at a time: enough to spread the cost of adding spectra, few enough for the cache."""

SEGMENTS_READ = 32
"""Segments read at a time."""


def output_covariances(
    recording: Recording, n_lags: int, *, references: Sequence[str] | None = None, first_lag: int = 1
) -> Array:
    """Covariances R_k = E[y_{j+k} y_ref_jᵀ] of the outputs with the reference outputs, lag by lag.

    Each record loses its own mean, and no product reaches from one record into another. The sum over a
    record of N samples has N - k terms; the total over all records is divided by the total number of terms,
    because a division by N would multiply R_k by (1 - k/N) and so add damping that is not there.

    Args:
        recording: outputs are read block by block, so that a recording on disk may exceed the memory.
        n_lags: how many lags.
        references: names of the reference outputs; all outputs when None.
        first_lag: the smallest lag k; 1 leaves out the lag that carries the measurement noise.

    Returns:
        R_k for k = first_lag, …, first_lag + n_lags - 1, shape (n_lags, n_outputs, n_references)
        [unit of output times unit of reference].

    Raises:
        TooShortError: the longest record is not longer than the largest lag.
        RecordingError: a reference does not exist, or a sample is missing.

    Source: Cambraia and Kurka (2010), VI CONEM, eq. (26) and (28); Peeters and De Roeck (1999), Mech. Syst.
        Signal Process. 13(6).
    """
    if n_lags < 1 or first_lag < 0:
        raise IdentificationError(
            f"{n_lags} lags from lag {first_lag} on were asked for; expected at least one lag, from lag 0 on"
        )
    n = first_lag + n_lags - 1
    longest = max(record.n_samples for record in recording.records)
    if longest <= n:
        raise TooShortError(
            f"lag {n} needs a record of more than {n} samples and the longest has {longest}; "
            "ask for fewer lags (fewer block rows) or record for longer"
        )
    rows = reference_rows(recording, references)
    total = np.zeros((n + 1, len(recording.outputs), rows.size))
    n_terms = np.zeros(n + 1)
    with np.errstate(invalid="ignore", over="ignore"):  # told by name just below
        for record in filter(lambda record: record.n_samples, recording.records):
            last = min(n, record.n_samples - 1)  # a short record has no larger lags
            total[: last + 1] += _products(record, rows, last)
            n_terms[: last + 1] += record.n_samples - np.arange(last + 1)
    if not np.isfinite(np.sum(total)):
        recording.require_complete()
        raise RecordingError("the squares of the outputs overflow; give the outputs in a smaller scale")
    total /= n_terms[:, None, None]
    return total[first_lag:]


def reference_rows(recording: Recording, references: Sequence[str] | None) -> NDArray[np.intp]:
    """Rows of the reference outputs.

    Args:
        recording: whose outputs they are.
        references: their names; all outputs when None.

    Returns:
        Shape (n_references,).

    Raises:
        RecordingError: a name is not among the outputs, appears twice, or none was given.
    """
    names = [channel.name for channel in recording.outputs]
    if references is None:
        return np.arange(len(names))
    chosen = list(references)
    if not chosen or len(set(chosen)) < len(chosen) or not set(chosen) <= set(names):
        raise RecordingError(
            f"references are {', '.join(map(repr, chosen)) or 'empty'}; "
            f"expected one or more different outputs out of {', '.join(names)}"
        )
    return np.array([names.index(name) for name in chosen])


def _products(record: Record, rows: NDArray[np.intp], n: int) -> Array:
    """Σ_j (y_{j+k} - ȳ)(y_ref_j - ȳ_ref)ᵀ over one record, shape (n + 1, n_outputs, n_references).

    The record is cut into segments: the references of `step` samples with the outputs of the same and n more
    samples. Both get the length of one fast Fourier transform, and their cross-spectra add up.
    """
    n_outputs = record.outputs.shape[0]
    length = _transform_length(n, record.n_samples, n_outputs * rows.size)
    step = length - n
    size = 1 << (SEGMENTS_READ * step - 1).bit_length()
    spectrum = np.zeros((length // 2 + 1, n_outputs, rows.size), complex)
    # Taking off a nearby constant first keeps a large offset from eating the digits of a small vibration.
    offset = np.mean(next(record.blocks(size))[1], axis=1, keepdims=True)
    pending = np.empty((n_outputs, 0))
    head = np.empty((n_outputs, 0))
    total = np.zeros(n_outputs)
    for _, block in record.blocks(size):
        block = block - offset
        total += np.sum(block, axis=1)
        if head.shape[1] < n:
            head = np.hstack([head, block[:, : n - head.shape[1]]])
        pending = np.hstack([pending, block])
        n_segments = (pending.shape[1] - n) // step
        if n_segments > 0:
            _add_cross_spectra(spectrum, _windows(pending, n_segments, step, length), rows, step)
            pending = pending[:, n_segments * step :]
    tail = pending[:, max(pending.shape[1] - n, 0) :].copy()
    n_segments = max(-(-pending.shape[1] // step), 1)
    pending = np.pad(pending, ((0, 0), (0, n_segments * step + n - pending.shape[1])))
    _add_cross_spectra(spectrum, _windows(pending, n_segments, step, length), rows, step)
    products = scipy.fft.irfft(spectrum, length, axis=0, overwrite_x=True)[: n + 1]
    return np.asarray(products - _mean_part(total, head, tail, rows, record.n_samples))


def _transform_length(n: int, n_samples: int, n_pairs: int) -> int:
    """A power of two of a few times the largest lag, as long as the cross-spectra fit in about 64 MiB."""
    largest = max(1 << 22, n_pairs) // n_pairs
    length = 1 << max(2 * n, 127).bit_length()
    while length < min(4 * n, n_samples, largest):
        length *= 2
    return length


def _windows(signals: Array, n_segments: int, step: int, length: int) -> Array:
    """The segments, each with the samples that follow it, shape (length, n_segments, n_outputs)."""
    windows = np.lib.stride_tricks.sliding_window_view(signals, length, axis=1)[:, ::step]
    return windows[:, :n_segments].transpose(2, 1, 0)


def _add_cross_spectra(
    spectrum: NDArray[np.complex128], windows: Array, rows: NDArray[np.intp], step: int
) -> None:
    """Add Σ over segments of Y(f) R(f)ᴴ, shape (n_frequencies, n_outputs, n_references)."""
    references = np.zeros((windows.shape[0], rows.size, min(SEGMENTS, windows.shape[1])))
    for first in range(0, windows.shape[1], SEGMENTS):
        part = windows[:, first : first + SEGMENTS]
        own = references[:, :, : part.shape[1]]
        own[:step] = part[:step, :, rows].transpose(0, 2, 1)
        # Frequencies first, as the products want them: a copy in another order would cost as much as they.
        Y = scipy.fft.rfft(part.transpose(0, 2, 1), axis=0)
        R = scipy.fft.rfft(own, axis=0)
        spectrum += Y @ np.conjugate(R, out=R).transpose(0, 2, 1)


def _mean_part(total: Array, head: Array, tail: Array, rows: NDArray[np.intp], n_samples: int) -> Array:
    """What the mean adds to the sums of products, shape (n_lags, n_outputs, n_references)."""
    mean = total / n_samples
    n = head.shape[1]
    before = np.hstack([np.zeros((total.size, 1)), np.cumsum(head, axis=1)])  # sum of the first k samples
    after = np.hstack(
        [np.zeros((total.size, 1)), np.cumsum(tail[:, ::-1], axis=1)]
    )  # sum of the last k samples
    late = (total[:, None] - before).T  # (n_lags, n_outputs): the samples that follow another one by k
    early = (total[:, None] - after).T[:, rows]
    n_terms = n_samples - np.arange(n + 1)
    part = late[:, :, None] * mean[rows] + mean[:, None] * early[:, None, :]
    return np.asarray(part - n_terms[:, None, None] * np.outer(mean, mean[rows]))
