"""What a recording looks like line by line: power and cross-spectra, and responses per unit of force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.covariance import output_covariances, reference_rows
from identification.errors import IdentificationError, RecordingError, TooShortError
from identification.estimators import (
    ESTIMATORS,
    Moments,
    excited,
    line_weight,
    multiple_coherence,
    residual_variance,
)
from identification.recording import Array, Channel, Recording
from identification.response import FrequencyResponse
from identification.segments import Segments, choose_segments, hann_segments, transforms

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False, repr=False)
class CrossSpectra:
    """Power and cross-spectra of the outputs, averaged over pieces of the records.

    Attributes:
        frequency_hz: shape (n_frequencies,).
        values: one-sided G(f) ∝ E[Y(f) Y(f)ᴴ], shape (n_frequencies, n_outputs, n_outputs)
            [product of the units / Hz].
        outputs: output channels.
        dt: sample time [s].
        segments: how the records were cut.
    """

    frequency_hz: Array
    values: Complex
    outputs: tuple[Channel, ...]
    dt: float
    segments: Segments

    def lag_window(self) -> Array:
        """What the window of the pieces multiplies the correlations by, lag by lag, shape (length,)."""
        w = self.segments.window
        spectrum = np.abs(np.fft.rfft(w, 2 * w.size)) ** 2
        return np.asarray(np.fft.irfft(spectrum)[: w.size] / np.sum(w**2))

    def __repr__(self) -> str:
        return (
            f"CrossSpectra({len(self.outputs)} outputs, {self.frequency_hz.size} lines up to "
            f"{self.frequency_hz[-1]:g} Hz, {self.segments.n_averages:.3g} averages)"
        )


def cross_spectra(
    recording: Recording,
    *,
    n_segment: int | None = None,
    zero_padding: int = 1,
    segments: Segments | None = None,
) -> CrossSpectra:
    """Cross-spectra of all outputs with one another, from half-overlapping pieces under a Hann window.

    Args:
        recording: read piece by piece, so that it may exceed the memory.
        n_segment: samples of a piece; chosen for about 32 averages when None.
        zero_padding: length of the transforms over that of the pieces. With 2, the inverse transform of a
            spectrum is the correlation of the pieces, not wrapped around.
        segments: the pieces themselves, in place of `n_segment`.

    Returns:
        One-sided densities at all lines.

    Raises:
        RecordingError: a sample is missing.
        TooShortError: no record is as long as `n_segment`.

    Source: Welch (1967), IEEE Trans. Audio Electroacoust. 15(2), 70-73, eq. (5) and (6).
    """
    segments = segments or hann_segments(recording, n_segment, n_averages=32)
    n = zero_padding * segments.length
    total = np.zeros((n // 2 + 1, len(recording.outputs), len(recording.outputs)), complex)
    with np.errstate(invalid="ignore", over="ignore"):  # told by name just below
        for Y in transforms(recording, segments, inputs=False, n_transform=n):
            total += Y @ Y.conj().transpose(0, 2, 1)
    _require_finite(recording, total)
    n_pieces = sum(len(starts) for starts in segments.starts)
    total *= recording.dt / (n_pieces * np.sum(segments.window**2))
    total[1 : (n + 1) // 2] *= 2  # one side stands for both
    f = np.arange(n // 2 + 1) / (n * recording.dt)
    return CrossSpectra(f, total, recording.outputs, recording.dt, segments)


def frequency_response(
    recording: Recording, estimator: str = "H1", *, n_segment: int | None = None, decay: float = 0.0
) -> FrequencyResponse:
    """Frequency response functions, with their coherence and variance where there is something to average.

    Records that begin at rest and ring down (pulse, impact, burst, sweep) are transformed whole and
    multisines period by period, both without leakage; each input may have a record of its own, since the
    records add up to one system of equations per line. Random records are cut into half-overlapping pieces
    under a Hann window, which lowers and widens a resonance unless a piece lasts several times as long as
    the resonance rings.

    Args:
        recording: inputs and outputs; read piece by piece.
        estimator: "H1" for noise on the outputs, "H2" on the inputs, "Hv" on both.
        n_segment: samples of a piece; asks for the Hann window, whatever the records are.
        decay: rate of an exponential window on transient records [1/s], inputs and outputs alike, for those
            that end before the structure rests. It shifts all poles by as much, which `plscf` undoes.

    Returns:
        H at all lines above zero where every input acts.

    Raises:
        RecordingError: a sample is missing, inputs were not measured, or nowhere act independently.
        TooShortError: no record is as long as `n_segment`.
        IdentificationError: the estimator is unknown, or an exponential window is asked for in vain.

    Source: Bendat and Piersol (2010), Random Data, ch. 7; Rocklin, Crowley and Vold (1985), Proc. 3rd IMAC;
        for periodic records Pintelon and Schoukens (2012), System Identification, section 2.5.
    """
    if estimator not in ESTIMATORS:
        raise IdentificationError(
            f"estimator {estimator!r} is unknown; expected one of {', '.join(ESTIMATORS)}"
        )
    if not recording.inputs or not all(record.inputs.shape[0] for record in recording.records):
        raise RecordingError(
            "a frequency response needs measured inputs and a record has none; "
            "use positive_spectra for outputs alone"
        )
    segments = choose_segments(recording, n_segment=n_segment, decay=decay)
    moments = _moments(recording, segments)
    use = excited(moments)
    use[: 2 if segments.kind == "stationary" else 1] = False  # what the offset of a sensor reaches
    if not use.any():
        raise RecordingError(
            f"the {len(recording.inputs)} inputs nowhere act independently in {segments.n_averages:.3g} pieces; "
            "record one test per input, or independent random forces for longer"
        )
    moments = moments.take(use)
    n_inputs, n = len(recording.inputs), segments.n_averages
    known = n > n_inputs + 0.5
    dropped = int(np.sum(~use))
    notes = segments.notes
    if dropped > 2:  # more than the offset
        notes = (*notes, f"{dropped} of {use.size} lines are left out, as an input is silent there.")
    return FrequencyResponse(
        np.flatnonzero(use) / (segments.length * recording.dt),
        ESTIMATORS[estimator](moments),
        recording.dt,
        recording.inputs,
        recording.outputs,
        coherence=multiple_coherence(moments) if known else None,
        variance=residual_variance(moments, n) if known else None,
        weight=line_weight(moments),
        n_averages=n,
        decay=decay,
        notes=notes,
    )


def positive_spectra(
    recording: Recording, n_lags: int, *, references: Sequence[str] | None = None, decay: float = 0.0
) -> FrequencyResponse:
    """Transforms of the output correlations at positive lags, which look like frequency responses.

    The correlations R_k = C A^{k-1} G have the transform C (z I - A)⁻¹ (I - A^n) G + R_0 / 2 at the lines of
    n lags, with the structure's own poles and without any leakage. Measurement noise that is white adds to
    the constant R_0 alone.

    Args:
        recording: outputs of a structure under random excitation; inputs are not used.
        n_lags: lags 0 to n_lags - 1.
        references: names of the reference outputs; all outputs when None.
        decay: rate of an exponential window on the correlations [1/s], against the scatter of late lags.

    Returns:
        A response per reference output; coherence and variance are not known.

    Raises:
        TooShortError: the longest record is not longer than the largest lag.
        RecordingError: a reference does not exist, or a sample is missing.

    Source: Peeters and Van der Auweraer (2005), Proc. 1st IOMAC, section 3; Cauberghe (2004), thesis, ch. 5.
    """
    if n_lags < 2:
        raise TooShortError(f"{n_lags} lags were asked for; expected at least 2")
    R = output_covariances(recording, n_lags, references=references, first_lag=0)
    R[0] /= 2
    R *= np.exp(-decay * recording.dt * np.arange(n_lags))[:, None, None]
    rows = reference_rows(recording, references)
    inputs = tuple(recording.outputs[row] for row in rows)
    f = np.arange(n_lags // 2 + 1) / (n_lags * recording.dt)
    return FrequencyResponse(f, np.fft.rfft(R, axis=0), recording.dt, inputs, recording.outputs, decay=decay)


def _moments(recording: Recording, segments: Segments) -> Moments:
    n_lines, n_u, n_y = segments.length // 2 + 1, len(recording.inputs), len(recording.outputs)
    uu, yu = np.zeros((n_lines, n_u, n_u), complex), np.zeros((n_lines, n_y, n_u), complex)
    yy = np.zeros((n_lines, n_y))
    with np.errstate(invalid="ignore", over="ignore"):  # told by name just below
        for X in transforms(recording, segments, inputs=True):
            U, Y = X[:, :n_u], X[:, n_u:]
            U_h = U.conj().transpose(0, 2, 1)
            uu += U @ U_h
            yu += Y @ U_h
            yy += np.sum(np.abs(Y) ** 2, axis=2)
    _require_finite(recording, uu, yu, yy)
    return Moments(uu, yu, yy)


def _require_finite(recording: Recording, *sums: NDArray[np.generic]) -> None:
    if not all(np.all(np.isfinite(each)) for each in sums):
        recording.require_complete()
        raise RecordingError("the squares of the signals overflow; give them in a smaller scale")


def unit_sizes(power: Array, channels: Sequence[Channel]) -> Array:
    """Size of each channel among those of other units: the root of the mean power of its unit, (n_channels,).

    Divided by it, channels of different units weigh alike, whatever the units are. Those of one unit share a
    size, because among them a small signal does weigh less against the noise.

    Args:
        power: of each channel, mean or sum, shape (n_channels,).
        channels: with their units.

    Returns:
        In the units of the channels.
    """
    units = np.array([channel.unit for channel in channels])
    size = np.ones(units.size)
    for unit in set(units):
        size[units == unit] = np.sqrt(np.mean(power[units == unit])) or 1.0
    return size
