"""Frequency responses of random records without leakage: a local model of response and transient at each line.

The Fourier transform of a piece of record that neither begins nor ends at rest is Y = H U + T, where T stems from the
states at its two ends and is as smooth in frequency as H is. Within a few lines both are low polynomials in
frequency, or near a light resonance such polynomials over a common one, so that least squares over these lines
separates H from T. No window is needed, and none lowers or widens a resonance.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.fft
import scipy.special
from numpy.typing import NDArray

from identification.errors import RecordingError, TooShortError
from identification.recording import Array, Recording
from identification.response import FrequencyResponse

Complex = NDArray[np.complex128]

DEGREE = 4
"""Of the local polynomials: with a denominator, four poles within a window are exact."""

SPARE = 8
"""Equations at least beyond the unknowns of a window, to tell the noise from."""

LONGEST = 1 << 14
"""Samples of a piece at most: more would only add lines."""

CHANCE = 1e-3
"""Probability that noise alone calls for a denominator."""

REFINEMENTS = 2
"""Times that the denominators are fitted anew with instruments; further times change less than the noise does."""

BATCH = 1 << 18
"""Complex numbers held at a time."""


def local_response(recording: Recording) -> FrequencyResponse:
    """Frequency response functions of random records by local modelling, with their variance.

    Noise is taken to be on the outputs, as for H1. A denominator is used at the lines and outputs where it explains
    more than noise would. Least squares would make the peak of a resonance that is one to three lines wide too low by
    some percent, and the damping as much too high, since noise is in the outputs that the denominator multiplies;
    instrumental variables do not.

    Args:
        recording: records with inputs and without missing samples; cut into pieces of one length.

    Returns:
        H at all lines above zero, below half the sample rate, where every input acts by itself.

    Raises:
        TooShortError: pieces with fewer lines than a window needs.
        RecordingError: a sample is missing, or inputs nowhere act independently.

    Source: Pintelon and Schoukens (2012), System Identification, 2nd ed., section 7.2.2 (local polynomial method);
        McKelvey and Guérin (2012), Proc. 16th IFAC SYSID, eq. (5), for the denominator; Söderström and Stoica (1989),
        System Identification, ch. 8, for the instruments, which are the responses of the model fitted before.
    """
    recording.require_complete()
    length, starts = _pieces(recording)
    n_pieces = sum(len(each) for each in starts)
    n_inputs = len(recording.inputs)
    width = _width(n_inputs, n_pieces)
    n_lines = (length - 1) // 2  # without zero and half the sample rate
    if width > n_lines:
        raise TooShortError(
            f"pieces of {length} samples have {n_lines} lines and a local model of {n_inputs} inputs needs {width}; "
            "record for longer"
        )
    U, Y = _transforms(recording, length, starts)  # (n_pieces, n_channels, n_lines)
    parts = list(_windows(U, Y, width))
    H, variance, gain, alive = (np.concatenate(each) for each in zip(*parts, strict=True))
    if not alive.any():
        raise RecordingError(
            f"the {n_inputs} inputs nowhere act independently in {n_pieces} pieces; "
            "record one test per input, or independent random forces for longer"
        )
    weight = 1 / np.sqrt(gain[alive])
    f = np.arange(1, n_lines + 1) / (length * recording.dt)
    note = (
        f"Responses and transients of {n_pieces} piece{'s' if n_pieces > 1 else ''} of {length} samples are told "
        f"apart by local models over {width} lines, free of leakage."
    )
    return FrequencyResponse(
        f[alive],
        H[alive],
        recording.dt,
        recording.inputs,
        recording.outputs,
        variance=variance[alive],
        weight=weight / np.mean(weight),
        n_averages=float(n_pieces),
        notes=(note,),
    )


def _pieces(recording: Recording) -> tuple[int, list[range]]:
    """Length of a piece and where the pieces of each record start; records much shorter than others have none."""
    sizes = [record.n_samples for record in recording.records]
    shortest = min(n for n in sizes if 2 * n >= max(sizes))
    length = shortest // -(-shortest // LONGEST)
    return length, [range(0, n - length + 1, length) for n in sizes]


def _width(n_inputs: int, n_pieces: int) -> int:
    """Lines of a window, odd: enough for the polynomials of each piece and for those that all pieces share."""
    shared = n_inputs * (DEGREE + 1) + DEGREE + SPARE
    return max(DEGREE + 1 - (-shared // n_pieces), 2 * DEGREE + 5) | 1


def _transforms(recording: Recording, length: int, starts: list[range]) -> tuple[Complex, Complex]:
    sides = []
    for name in ("inputs", "outputs"):
        pieces = [
            scipy.fft.rfft(np.asarray(getattr(record, name)[:, k : k + length], dtype=float))
            for record, own in zip(recording.records, starts, strict=True)
            for k in own
        ]
        sides.append(np.stack(pieces)[:, :, 1 : (length + 1) // 2])
    return sides[0], sides[1]


class _Lines(NamedTuple):
    """What a batch of lines gives: H, its variance, the scatter per noise, and whether the inputs act there."""

    H: Complex
    variance: Array
    gain: Array
    alive: NDArray[np.bool_]


def _windows(U: Complex, Y: Complex, width: int) -> Iterator[_Lines]:
    """Local models at all lines, batch by batch."""
    n_pieces, n_inputs, n_lines = U.shape
    size = np.sqrt(np.mean(np.abs(U) ** 2, axis=(0, 2)))
    if not np.all(size > 0):
        raise RecordingError("an input is silent throughout; leave it out")
    step = max(BATCH // (n_pieces * width * (n_inputs * (DEGREE + 1) + 4 * Y.shape[1])), 1)
    t = np.linspace(-1, 1, width)
    # Transients have the same span in every window.
    smooth = np.linalg.qr(t[:, None] ** np.arange(DEGREE + 1))[0].astype(complex)
    for low in range(0, n_lines, step):
        k = np.arange(low, min(low + step, n_lines))
        first = np.clip(k - width // 2, 0, n_lines - width)
        lines = first[:, None] + np.arange(width)  # (n_k, width)
        r = 2 * (lines - k[:, None]) / width
        u, y = (
            X[:, :, lines].transpose(2, 1, 0, 3) for X in (U / size[:, None], Y)
        )  # (n_k, ., n_pieces, width)
        yield _local(u, y, r[:, :, None] ** np.arange(DEGREE + 1), smooth, size)


def _local(u: Complex, y: Complex, powers: Array, smooth: Complex, size: Array) -> _Lines:
    """Polynomial models of each line, and rational ones where they explain more than chance would."""
    n_k, n_inputs, n_pieces, width = u.shape

    def without_transient(X: Complex) -> Complex:
        flat = X.reshape(-1, width)
        return np.asarray(flat - (flat @ smooth) @ smooth.T).reshape(*X.shape[:-2], n_pieces * width)

    def times_powers(X: Complex, first: int) -> Complex:
        return np.asarray(X[:, :, None] * powers[:, :, first:].transpose(0, 2, 1)[:, None, :, None])

    X = without_transient(times_powers(u, 0)).reshape(n_k, n_inputs * (DEGREE + 1), -1).transpose(0, 2, 1)
    Q, R = np.linalg.qr(X)
    diagonal = np.abs(np.diagonal(R, axis1=1, axis2=2))
    alive = np.min(diagonal, axis=1) > 1e-8 * np.max(diagonal, axis=1)
    R[~alive] = np.eye(R.shape[1])
    rest = without_transient(y)  # (n_k, n_outputs, n_equations)
    Qc, Qt = Q.conj(), Q.transpose(0, 2, 1)
    b = rest @ Qc  # (n_k, n_outputs, n_columns)
    left = rest - b @ Qt
    # Near a resonance: y + a_1 r y + a_2 r² y + … in place of y.
    Z = without_transient(times_powers(y, 1))  # (n_k, n_outputs, DEGREE, n_equations)
    d = Z @ Qc[:, None]
    Z = Z - d @ Qt[:, None]
    a, Rz = _along(_orthonormal(Z), Z, -left)
    rational = left + (a[:, :, None] @ Z)[:, :, 0]
    n_free = n_pieces * (width - DEGREE - 1) - n_inputs * (DEGREE + 1)
    power, power_rational = (np.sum(np.abs(e) ** 2, axis=2) for e in (left, rational))
    use = power_rational * scipy.special.fdtri(2 * DEGREE, 2 * (n_free - DEGREE), 1 - CHANCE) * DEGREE < (
        power - power_rational
    ) * (n_free - DEGREE)
    # Noise in r y, r² y, … makes resonances too low; what the model makes of y is free of it.
    for _ in range(REFINEMENTS):
        e = (left + (a[:, :, None] @ Z)[:, :, 0]).reshape(y.shape)
        denominator = 1 + a @ powers[:, :, 1:].transpose(0, 2, 1)  # (n_k, n_outputs, width)
        instruments = without_transient(times_powers(y - e / denominator[:, :, None], 1))
        instruments = instruments - (instruments @ Qc[:, None]) @ Qt[:, None]
        a, Rz = _along(_orthonormal(instruments), Z, -left)
    b = b + (np.where(use[:, :, None], a, 0)[:, :, None] @ d)[:, :, 0]
    noise = np.where(use, power_rational / (n_free - DEGREE), power / n_free)
    inverse = np.linalg.inv(R)[:, :: DEGREE + 1]  # rows of b_j0, (n_k, n_inputs, n_columns)
    H = b @ inverse.transpose(0, 2, 1) / size
    spread = np.sum(np.abs(inverse) ** 2, axis=2)  # (n_k, n_inputs)
    along = np.linalg.solve(Rz.transpose(0, 1, 3, 2), d @ inverse.transpose(0, 2, 1)[:, None])
    further = np.where(use[:, :, None], np.sum(np.abs(along) ** 2, axis=2), 0)  # what the denominator adds
    variance = noise[:, :, None] * (spread[:, None] + further) / size**2
    return _Lines(H, variance, np.sum(spread, axis=1), alive)


def _orthonormal(Z: Complex) -> Complex:
    """Q of each Z, transposed, shape (n_k, n_outputs, n_equations, DEGREE)."""
    return np.asarray(np.linalg.qr(Z.transpose(0, 1, 3, 2))[0])


def _along(Q: Complex, Z: Complex, target: Complex) -> tuple[Complex, Complex]:
    """Coefficients a for which Σ_s a_s Z_s and the target are alike along Q, and Qᴴ Zᵀ; zero where Z does not tell.

    With Q of Z itself this is least squares, with Q of other regressors an instrumental-variable estimate.

    Returns:
        Shapes (n_k, n_outputs, DEGREE) and (n_k, n_outputs, DEGREE, DEGREE).
    """
    Qh = Q.conj().transpose(0, 1, 3, 2)
    R = Qh @ Z.transpose(0, 1, 3, 2)
    size = np.abs(np.diagonal(R, axis1=2, axis2=3))
    poor = np.min(size, axis=2) <= 1e-10 * np.max(size, axis=2)
    R = np.where(poor[:, :, None, None], np.eye(DEGREE), R)
    a = np.linalg.solve(R, Qh @ target[..., None])[..., 0]
    return np.asarray(np.where(poor[:, :, None], 0, a)), R
