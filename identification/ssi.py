"""Stochastic subspace identification: models of the structure from its outputs alone.

The covariances R_k = C A^{k-1} G of the outputs with some references fill a block Hankel matrix, whose
leading left singular vectors span the observability matrix of the structure.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.covariance import output_covariances, reference_rows
from identification.errors import IdentificationError, OrderError
from identification.hankel import shift_invariance
from identification.horizon import resonance_peaks
from identification.modes import Modes
from identification.recording import Array, Recording
from identification.systems import Realization, StateSpace

MAX_ORDER = 100
MAX_COLUMNS = 1500
MAX_VALUES = 1 << 24


def ssi_cov(
    recording: Recording,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    n_rows: int | None = None,
    references: Sequence[str] | None = None,
) -> Realization:
    """Models of every order from the covariances of the outputs with the references (SSI-cov/ref).

    Args:
        recording: outputs of a structure under random excitation, measured or not; inputs are not used.
        order: number of states of the model to choose; the largest gap of the singular values decides when
            None.
        orders: orders to realize besides `order`; when both are None, 2, 4, … up to six for each resonance
            peak in the spectra.
        n_rows: block rows of the Hankel matrix, so that lags 1 to 2 `n_rows` - 1 are used; one period of
            the lowest resonance peak when None.
        references: names of the reference outputs, of which each covariance takes one; all outputs when None.

    Returns:
        The models, without inputs, and the leading singular values.

    Raises:
        OrderError: an order below 1, or above what the Hankel matrix can carry.
        TooShortError: the record has fewer samples than lags.
        RecordingError: a reference does not exist, or a sample is missing.

    Source: Peeters and De Roeck (1999), Mech. Syst. Signal Process. 13(6); Cambraia and Kurka (2010), VI
        CONEM, eqs. (24) to (37), with the block columns of eq. (29) in reverse order.
    """
    n_outputs, n_references = len(recording.outputs), reference_rows(recording, references).size
    notes: list[str] = []
    sweep = order is None and orders is None
    peaks = resonance_peaks(recording) if sweep or n_rows is None else []
    if sweep:
        orders, reason = _choose_orders(recording, len(peaks))
        notes.append(reason)
    wanted = _sorted_orders(order, orders)
    if n_rows is None:
        n_rows, reason = _choose_rows(recording, peaks, wanted[-1], n_references)
        notes.append(reason)
    elif n_rows < 2:
        raise IdentificationError(f"{n_rows} block rows were asked for; expected at least 2")
    stride = -(-n_rows * n_references // MAX_COLUMNS)
    n_columns = -(-n_rows // stride)
    largest = min((n_rows - 1) * n_outputs, n_columns * n_references)
    if wanted[-1] > largest:
        raise OrderError(
            f"order {wanted[-1]} exceeds {largest}, the most that {n_rows} block rows of {n_outputs} outputs "
            f"with {n_references} references carry; lower the order or take more block rows"
        )
    R = output_covariances(recording, n_rows + stride * (n_columns - 1), references=references)
    scale = _balance(R, recording, reference_rows(recording, references))
    H = np.hstack([R[j * stride :][:n_rows].reshape(-1, n_references) for j in range(n_columns)])
    del R
    U, singular_values = leading_subspace(H, wanted[-1] + 2)
    rank = int(np.sum(singular_values > np.finfo(float).eps * max(H.shape) * singular_values[0]))
    del H
    if sweep:
        wanted = [n for n in wanted if n <= rank] or wanted[:1]
    if wanted[-1] > rank:
        raise OrderError(
            f"order {wanted[-1]} exceeds {rank}, the numerical rank of the Hankel matrix; lower the order"
        )
    systems = tuple(
        _outputs_only(A, C * scale, recording)
        for A, C in shift_invariance(U, singular_values, n_outputs=n_outputs, orders=wanted)
    )
    if order is None:
        order = _largest_gap(singular_values, wanted)
        notes.append(f"The singular values drop most steeply after the first {order}.")
    settings: dict[str, int | float | str] = {
        "n_rows": n_rows,
        "n_columns": n_columns,
        "stride": stride,
        "n_references": n_references,
    }
    realization = Realization("ssi_cov", systems, singular_values, order, settings, tuple(notes))
    return replace(realization, notes=(*notes, *horizon_warning(realization.system.modes(), realization)))


def leading_subspace(H: Array, n: int) -> tuple[Array, Array]:
    """Leading left singular vectors of a matrix and their singular values, largest first.

    The eigenvectors of H Hᵀ or Hᵀ H, whichever is smaller, cost a fraction of a singular value
    decomposition, but squaring loses singular values below √ε of the largest. When one of those asked for
    is that small, the data are nearly free of noise and the decomposition of H itself follows.

    Args:
        H: shape (n_rows, n_columns).
        n: how many; at most all.

    Returns:
        U, shape (n_rows, n), and the singular values, shape (n,).
    """
    small = min(H.shape)
    n = min(n, small)
    wide = H.shape[0] <= H.shape[1]
    G = H @ H.T if wide else H.T @ H
    subset = (small - n, small - 1) if 6 * n < small else None  # otherwise all cost less
    w, V = scipy.linalg.eigh(G, subset_by_index=subset, overwrite_a=True, check_finite=False)
    w, V = w[::-1][:n], V[:, ::-1][:, :n]
    if w[-1] <= 1e3 * small * np.finfo(float).eps * w[0]:
        U, s, _ = scipy.linalg.svd(H, full_matrices=False, check_finite=False)
        return U[:, :n], s[:n]
    s = np.sqrt(w)
    return (V if wide else H @ (V / s)), s


def _outputs_only(A: Array, C: Array, recording: Recording) -> StateSpace:
    n = len(A)
    return StateSpace(A, np.zeros((n, 0)), C, np.zeros((len(C), 0)), recording.dt, (), recording.outputs)


def _choose_orders(recording: Recording, n_peaks: int) -> tuple[range, str]:
    """Orders to sweep, three times as many modes as there are resonance peaks, and the reason."""
    highest = min(max(6 * n_peaks, 20), MAX_ORDER)
    affordable = max(recording.n_samples // 20 * 2, 2)
    if affordable < highest:
        return range(2, affordable + 1, 2), f"Orders go up to {affordable}, one state per ten samples."
    return range(2, highest + 1, 2), (
        f"Orders go up to {highest}, as the spectra show {n_peaks} resonance peaks "
        f"and three times as many modes are allowed for (at least 10, at most {MAX_ORDER // 2})."
    )


def _sorted_orders(order: int | None, orders: Iterable[int] | None) -> list[int]:
    wanted = sorted({*(orders or ()), *(() if order is None else (order,))})
    if not wanted or wanted[0] < 1:
        raise OrderError(f"orders are {wanted}; expected whole numbers from 1 on")
    return wanted


def _choose_rows(
    recording: Recording, peaks: Sequence[float], order: int, n_references: int
) -> tuple[int, str]:
    """Block rows for the slowest oscillation, the highest order and the length of the record; the reason."""
    longest = max(record.n_samples for record in recording.records)
    period = math.ceil(recording.sample_rate / peaks[0]) if peaks else 0
    for_order = 2 + -(-3 * order // (2 * n_references))
    limit = max(min(longest // 4, MAX_VALUES // (MAX_COLUMNS * len(recording.outputs))), 2)
    if limit < max(period, for_order):
        n_rows, why = limit, "the most that the length of the record or the memory allows"
    elif period >= for_order:
        n_rows, why = period, f"one period of the lowest resonance peak, at {peaks[0]:.4g} Hz"
    else:
        n_rows, why = for_order, f"one and a half times as many as order {order} needs"
    return n_rows, f"The horizon is {n_rows} block rows, {why}."


def horizon_warning(modes: Modes, realization: Realization) -> tuple[str, ...]:
    """One sentence when the horizon is shorter than half a period of the slowest light mode, else none."""
    light = modes.frequency_hz[(modes.damping_ratio > 0) & (modes.damping_ratio < 0.3)]
    if not light.size:
        return ()
    n_rows, rate = int(realization.settings["n_rows"]), 1 / realization.system.dt
    if 2 * n_rows * light[0] >= rate:
        return ()
    return (
        f"{n_rows} block rows span less than half a period of the mode at {light[0]:.4g} Hz, which is then "
        f"mostly noise; take at least {math.ceil(rate / light[0])} block rows.",
    )


def _balance(R: Array, recording: Recording, rows: NDArray[np.intp]) -> Array:
    """Bring outputs of different units to one scale, in place; gives that scale, shape (n_outputs, 1).

    Without it the choice of a unit would decide which outputs the truncated subspace follows. Outputs of
    one unit share a scale, because among them the size of a signal does tell its weight against the noise.
    """
    units = np.array([channel.unit for channel in recording.outputs])
    scale = np.ones(units.size)
    if np.all(units == units[0]):
        return scale[:, None]
    reference_scale = np.ones(rows.size)
    for unit in set(units):
        scale[units == unit] = np.linalg.norm(R[:, units == unit]) or 1.0
        reference_scale[units[rows] == unit] = np.linalg.norm(R[:, :, units[rows] == unit]) or 1.0
    R /= scale[:, None] * reference_scale
    return scale[:, None]


def _largest_gap(singular_values: Array, orders: Sequence[int]) -> int:
    """The order after which the singular values fall by the largest factor."""
    s = np.maximum(singular_values, np.finfo(float).tiny)
    n = np.array([order for order in orders if order < s.size] or orders[:1])
    return int(n[np.argmax(s[n - 1] / s[np.minimum(n, s.size - 1)])])
