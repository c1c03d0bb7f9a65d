"""Long signals made small enough to draw: min/max envelopes, averaged spectra and frequency responses.

Everything reads the recording block by block, so that a recording larger than memory can be drawn.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.fft

from identification.recording import Channel, Record, Recording

TRANSIENT = ("pulse", "impact", "burst_random", "free_decay")
"""Kinds whose records begin and end at rest, so that a whole record needs no window."""


@dataclass(frozen=True, eq=False)
class Envelope:
    """Signals of one record at few enough points to draw.

    Attributes:
        time: [s] from the start of the record, shape (n_points,).
        inputs: shape (n_inputs, n_points).
        outputs: shape (n_outputs, n_points).
        samples_per_bin: samples behind each pair of minimum and maximum; 1 when every sample is there.
    """

    time: np.ndarray
    inputs: np.ndarray
    outputs: np.ndarray
    samples_per_bin: int


@dataclass(frozen=True, eq=False)
class Spectra:
    """Spectral densities averaged over segments, one-sided.

    Attributes:
        frequency_hz: shape (n_frequencies,).
        output_density: [unit²/Hz], shape (n_outputs, n_frequencies).
        input_density: Hermitian matrices of the inputs, shape (n_frequencies, n_inputs, n_inputs).
        cross_density: outputs against inputs, shape (n_frequencies, n_outputs, n_inputs).
        n_averages: segments averaged.
        window: "Hann", or "none" for whole transient records.
        remainder: RMS of the last tenth of the segments over that of the first, the largest of all outputs.
    """

    frequency_hz: np.ndarray
    output_density: np.ndarray
    input_density: np.ndarray
    cross_density: np.ndarray
    n_averages: int
    window: str
    remainder: float


def envelope(record: Record, sample_rate: float, *, n_bins: int = 2000) -> Envelope:
    """Every sample of a short record; minimum and maximum of each of at most `n_bins` bins of a longer one.

    Args:
        record: one test run.
        sample_rate: [Hz].
        n_bins: a record of up to twice as many samples is kept whole.

    Returns:
        The envelope; a bin without any sample that is a number stays NaN, a gap in the drawing.
    """
    n = record.n_samples
    if n <= 2 * n_bins:
        parts = [(block_in, block_out) for block_in, block_out in record.blocks(n)] if n else []
        size = 1
    else:
        size = -(-n // n_bins)
        parts = [
            (_extremes(block_in, size), _extremes(block_out, size))
            for block_in, block_out in record.blocks(size * max(1, (1 << 16) // size))
        ]
    inputs = np.concatenate([part[0] for part in parts], axis=1) if parts else np.zeros((0, 0))
    outputs = (
        np.concatenate([part[1] for part in parts], axis=1)
        if parts
        else np.zeros((record.outputs.shape[0], 0))
    )
    step = 1.0 if size == 1 else size / 2
    return Envelope(np.arange(outputs.shape[1]) * step / sample_rate, inputs, outputs, size)


def _extremes(block: np.ndarray, size: int) -> np.ndarray:
    """Minimum and maximum of every `size` samples, in turn: shape (n_channels, 2 * n_bins)."""
    n_bins = -(-block.shape[1] // size)
    missing = n_bins * size - block.shape[1]
    if missing:
        block = np.pad(block, ((0, 0), (0, missing)), constant_values=np.nan)
    binned = block.reshape(block.shape[0], n_bins, size)
    pairs = np.stack([np.fmin.reduce(binned, axis=2), np.fmax.reduce(binned, axis=2)], axis=2)
    return pairs.reshape(block.shape[0], 2 * n_bins)


def spectra(recording: Recording, *, n_segment: int = 8192, n_averages: int = 128) -> Spectra | None:
    """Welch's averaged spectra of all records that share the inputs.

    Transient records (a pulse, an impact, …) are taken whole, one average each, when there are at least as
    many of them as inputs; anything else in half-overlapping Hann segments, of which `n_averages` spread over
    the recording suffice for a drawing.

    Args:
        recording: measured or simulated.
        n_segment: samples per segment at most; a shorter recording is cut in about eight.
        n_averages: segments used at most.

    Returns:
        The spectra, or None when no stretch without a missing sample is long enough.

    Source: Welch (1967), IEEE Trans. Audio Electroacoust. 15(2), 70-73.
    """
    n_inputs = len(recording.inputs) if all(r.inputs.shape[0] for r in recording.records) else 0
    whole = len(recording.records) >= max(1, n_inputs) and all(r.kind in TRANSIENT for r in recording.records)
    shortest = min(record.n_samples for record in recording.records)
    if whole:
        n = min(shortest, 1 << 16)
    else:
        n = min(n_segment, shortest, max(256, 1 << int(np.log2(max(recording.n_samples / 4, 1)))))
    if n < 8:
        return None
    window = np.ones(n) if whole else np.sin(np.pi * np.arange(n) / n) ** 2
    n_frequencies = n // 2 + 1
    outputs = np.zeros((len(recording.outputs), n_frequencies))
    inputs = np.zeros((n_frequencies, n_inputs, n_inputs), dtype=complex)
    cross = np.zeros((n_frequencies, len(recording.outputs), n_inputs), dtype=complex)
    first, last, tenth = *np.zeros((2, len(recording.outputs))), -(-n // 10)
    count = 0
    for u, y in _segments(recording, n, n if whole else n // 2, n_averages):
        if not whole:
            u, y = (x - x.mean(axis=1, keepdims=True) for x in (u, y))
        Y = scipy.fft.rfft(y * window, axis=1)
        U = scipy.fft.rfft(u * window, axis=1)[:n_inputs].T
        outputs += np.abs(Y) ** 2
        inputs += U[:, :, None] * U[:, None, :].conj()
        cross += Y.T[:, :, None] * U[:, None, :].conj()
        first += np.sum(y[:, :tenth] ** 2, axis=1)
        last += np.sum(y[:, -tenth:] ** 2, axis=1)
        count += 1
    if not count:
        return None
    scale = np.full(n_frequencies, 2 / (count * recording.sample_rate * np.sum(window**2)))
    scale[0] /= 2
    if n % 2 == 0:
        scale[-1] /= 2
    return Spectra(
        scipy.fft.rfftfreq(n, recording.dt),
        outputs * scale,
        inputs * scale[:, None, None],
        cross * scale[:, None, None],
        count,
        "none" if whole else "Hann",
        float(np.sqrt(np.max(last / np.where(first > 0, first, np.inf), initial=0.0))),
    )


def _segments(recording: Recording, n: int, hop: int, limit: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """At most `limit` complete segments of `n` samples, spread evenly; a transient record gives one."""
    starts = [
        (record, start)
        for record in recording.records
        for start in ([0] if hop == n else range(0, record.n_samples - n + 1, hop))
    ]
    every = 1 if hop == n else -(-len(starts) // limit)
    for record, start in starts[::every]:
        y = np.asarray(record.outputs[:, start : start + n], dtype=float)
        u = np.asarray(record.inputs[:, start : start + n], dtype=float) if record.inputs.shape[0] else y[:0]
        if np.isfinite(np.sum(y)) and np.isfinite(np.sum(u)):
            yield u, y


def frequency_response(spectrum: Spectra) -> np.ndarray | None:
    """H1 = G_yu G_uu⁻¹ where the inputs can be told apart, shape (n_frequencies, n_outputs, n_inputs).

    Lines at which the inputs are (nearly) coherent or absent are NaN; None when all are, or without inputs.

    Source: Bendat and Piersol (2010), Random Data, 4th ed., ch. 7: least squares with noise on the outputs.
    """
    G = spectrum.input_density
    if not G.shape[1]:
        return None
    power = np.abs(np.diagonal(G, axis1=1, axis2=2))  # (n_frequencies, n_inputs)
    good = np.all(power > 1e-12 * power.max(axis=0), axis=1)
    # Scaled to a unit diagonal, so that newtons and newton metres weigh the same.
    root = np.sqrt(power[good])
    coherence = G[good] / (root[:, :, None] * root[:, None, :])
    good[good] = np.linalg.eigvalsh(coherence)[:, 0] > 1e-8
    if not good.any():
        return None
    H = np.full(spectrum.cross_density.shape, np.nan, dtype=complex)
    H[good] = spectrum.cross_density[good] @ np.linalg.inv(G[good])
    return H


def coherence(spectrum: Spectra) -> np.ndarray | None:
    """Multiple coherence of each output with all inputs, 0 to 1, shape (n_outputs, n_frequencies); NaN at dead lines.

    None without inputs, or with fewer than twice as many averages as inputs: pure noise, whose coherence is
    about inputs over averages, would look explained.

    Source: Bendat and Piersol (2010), Random Data, 4th ed., ch. 7: G_yu G_uu⁻¹ G_uy / G_yy.
    """
    H = frequency_response(spectrum)
    if H is None or spectrum.n_averages < 2 * spectrum.input_density.shape[1]:
        return None
    explained = np.sum(H * spectrum.cross_density.conj(), axis=2).real.T
    lively = spectrum.output_density > 0
    return np.divide(explained, spectrum.output_density, out=np.full(explained.shape, np.nan), where=lively)


def mean_density(spectrum: Spectra) -> np.ndarray:
    """Mean over outputs of density over its own total, shape (n_frequencies,): one curve for mixed units."""
    total = np.sum(spectrum.output_density, axis=1, keepdims=True)
    lively = total[:, 0] > 0
    if not lively.any():
        return np.zeros(spectrum.frequency_hz.size)
    return np.mean(spectrum.output_density[lively] / total[lively], axis=0)


def measured_inputs(recording: Recording) -> tuple[Channel, ...]:
    """The input channels, unless no record has them."""
    return recording.inputs if any(record.inputs.shape[0] for record in recording.records) else ()


def upper_frequency(sample_rate: float, modes_hz: np.ndarray) -> float:
    """Where a frequency axis ends: half above the highest mode, and at most half the sample rate [Hz]."""
    highest = float(np.max(modes_hz, initial=0.0))
    return min(sample_rate / 2, 1.5 * highest) if highest > 0 else sample_rate / 2
