"""How far the randomness of a record moves the poles of `ssi_cov`, `ssi_data` and `next_era`.

A pole z of a model with H = O Γ moves by a (dH(1) - z dH(0)) b with a = ψᴴ O⁺ and b = Γ⁺ φ. Each covariance
is a mean of products over time, and so is this: of [α(t + 1) - z α(t)] β(t), where α gathers the outputs
from t on, weighted by a, and β the references before t, weighted by b. What the record leaves open is then how
the mean of this series scatters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import scipy.fft
import scipy.linalg
from numpy.typing import NDArray

from identification.covariance import output_covariances, reference_rows
from identification.hankel_perturbation import observability
from identification.recording import Array, Record, Recording
from identification.series_scatter import std_of_sum
from identification.ssi import balance
from identification.systems import Realization

Complex = NDArray[np.complex128]
N_BINS = 2048
"""Parts of the recording whose sums are kept."""
SEGMENTS = 16
"""Segments filtered at a time."""


class Influence(NamedTuple):
    """Weights by which the data move some poles.

    Attributes:
        z: sampled poles, shape (n_poles,).
        future: a, weights of the outputs, shape (n_poles, n_rows - 1, n_outputs).
        past: b, weights of the references, shape (n_poles, reach, n_references); the first meets the sample just
            before.
    """

    z: Complex
    future: Complex
    past: Complex


def covariance_scatter(
    recording: Recording,
    realization: Realization,
    poles: Sequence[tuple[int, complex]],
    *,
    references: Sequence[str] | None = None,
) -> tuple[Array, Array]:
    """Standard deviations of frequencies and damping ratios from models that rest on output covariances.

    Args:
        recording: the one that was realized.
        realization: by `ssi_cov`, `ssi_data` or `next_era`.
        poles: order and continuous-time pole [rad/s] of each mode.
        references: those that the method was given.

    Returns:
        Of the frequencies [Hz] and of the damping ratios, shape (n_poles,) each.

    Raises:
        TooShortError: the record is not many times longer than the lags used.
        IdentificationError: a model grows beyond all bounds.

    Source: first order as in Reynders, Pintelon and De Roeck (2008), Mech. Syst. Signal Process. 22(4), and
        Döhler and Mevel (2013), Mech. Syst. Signal Process. 38(2), without their matrices of the size of H².
    """
    influence = _influence(recording, realization, poles, references)
    rows = reference_rows(recording, references)
    z, dt = influence.z, recording.dt
    pole, omega = np.log(z) / dt, np.abs(np.log(z)) / dt
    to_frequency = pole.conj() / (2 * np.pi * omega * z * dt)
    to_damping = (pole.real * pole.conj() / omega**3 - 1 / omega) / (z * dt)
    width = max(1, recording.n_samples // N_BINS)
    sums, n_terms = [], 0
    for record in recording.records:
        for series in _series(record, rows, influence):
            both = np.real(np.stack([to_frequency, to_damping])[:, :, None] * series)
            whole = both.shape[-1] // width * width
            sums.append(both[..., :whole].reshape(*both.shape[:2], -1, width).sum(axis=-1))
            n_terms += whole
    bins = np.concatenate(sums, axis=-1) if sums else np.zeros((2, z.size, 0))
    memory = (influence.future.shape[1] + influence.past.shape[1]) / width
    std = std_of_sum(bins, memory) / max(n_terms, 1)
    return std[0], std[1]


def _influence(
    recording: Recording,
    realization: Realization,
    poles: Sequence[tuple[int, complex]],
    references: Sequence[str] | None,
) -> Influence:
    n_rows, n_columns, stride, n_references = (
        int(realization.settings[name]) for name in ("n_rows", "n_columns", "stride", "n_references")
    )
    n_outputs, rows = len(recording.outputs), reference_rows(recording, references)
    # NExT-ERA shifts all block rows, the others all but the last.
    ahead = n_rows if realization.method == "next_era" else n_rows - 1
    R = output_covariances(recording, n_rows + stride * (n_columns - 1), references=references)
    scale = balance(R, recording, rows)
    past = range(0, stride * n_columns, stride)
    weight = np.eye(n_columns * n_references)
    if realization.method == "ssi_data":
        weight = _whitening(recording, rows, past, scale)
    H = np.hstack([R[lag : lag + n_rows].reshape(-1, rows.size) for lag in past]) @ weight
    a = np.empty((len(poles), ahead, n_outputs), dtype=complex)
    b = np.zeros((len(poles), stride * (n_columns - 1) + 1, n_references), dtype=complex)
    z = np.empty(len(poles), dtype=complex)
    for order in {order for order, _ in poles}:
        system = realization.at(order)
        observed = observability(system.A, system.C / scale, n_rows)
        right = weight @ np.linalg.pinv(np.linalg.pinv(observed) @ H)  # Γ⁺
        left = np.linalg.pinv(observed[: ahead * n_outputs])
        values, psi, phi = scipy.linalg.eig(system.A, left=True, right=True)
        for k in (k for k, (own, _) in enumerate(poles) if own == order):
            i = int(np.argmin(np.abs(values - np.exp(poles[k][1] * recording.dt))))
            z[k] = values[i]
            vector = psi[:, i].conj() / (psi[:, i].conj() @ phi[:, i])
            a[k] = (vector @ left).reshape(ahead, n_outputs)
            b[k, ::stride] = (right @ phi[:, i]).reshape(n_columns, n_references)
    return Influence(z, np.asarray(a / scale[:, 0]), np.asarray(b / scale[rows, 0]))


def _whitening(recording: Recording, rows: NDArray[np.intp], past: range, scale: Array) -> Array:
    """L⁻ᵀ with L Lᵀ the covariance of the past: H L⁻ᵀ is the projection of the future, up to a rotation.

    How L moves does not move the poles, as it changes Γ alone in H = O Γ.
    """
    names = [recording.outputs[row].name for row in rows]
    R = output_covariances(recording, past[-1] + 1, references=names, first_lag=0)[:, rows]
    R /= scale[rows] * scale[rows, 0]
    block = [[R[q - p] if q >= p else R[p - q].T for q in past] for p in past]
    # Where outputs tell the same twice, the inverse root leaves out what they have in common.
    w, V = scipy.linalg.eigh(np.block(block))
    seen = w > np.finfo(float).eps * w.size * w[-1]
    return np.asarray(V[:, seen] / np.sqrt(w[seen]))


def _series(record: Record, rows: NDArray[np.intp], influence: Influence) -> Iterator[Complex]:
    """Pieces of [α(t + 1) - z α(t)] β(t) over a record, shape (n_poles, n) each."""
    ahead, reach = influence.future.shape[1], influence.past.shape[1]
    length = 1 << (4 * (ahead + reach) - 1).bit_length()
    step = length - ahead - reach
    W_future = scipy.fft.fft(influence.future[:, ::-1], length, axis=1).transpose(1, 0, 2)
    W_past = scipy.fft.fft(influence.past, length, axis=1).transpose(
        1, 0, 2
    )  # (length, n_poles, n_references)
    for first in range(reach, record.n_samples - ahead, SEGMENTS * step):
        last = min(first + SEGMENTS * step, record.n_samples - ahead)
        y = np.asarray(record.outputs[:, first - reach : last + ahead], dtype=float)
        y = y - np.mean(y, axis=1, keepdims=True)
        n_segments = -(-(last - first) // step)
        y = np.pad(y, ((0, 0), (0, n_segments * step + ahead + reach - y.shape[1])))
        windows = np.lib.stride_tricks.sliding_window_view(y, length, axis=1)[:, ::step]
        Y = np.ascontiguousarray(scipy.fft.fft(windows).transpose(2, 0, 1))  # (length, n_outputs, n_segments)
        # Filters answer from the present back: α stands `ahead` - 1 samples late, β one sample early.
        alpha = scipy.fft.ifft(W_future @ Y, axis=0)[reach + ahead - 1 :]
        beta = scipy.fft.ifft(W_past @ Y[:, rows], axis=0)[reach - 1 : reach - 1 + step]
        series = (alpha[1 : step + 1] - influence.z[:, None] * alpha[:step]) * beta
        yield series.transpose(1, 2, 0).reshape(influence.z.size, -1)[:, : last - first]
