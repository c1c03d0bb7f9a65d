"""Stochastic subspace identification: models of the structure from its outputs alone.

The covariances R_k = C A^{k-1} G of the outputs with some references fill a block Hankel matrix, whose
leading left singular vectors span the observability matrix of the structure.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.covariance import output_covariances, reference_rows
from identification.errors import IdentificationError, OrderError
from identification.hankel import shift_invariance
from identification.horizon import MAX_COLUMNS, choose_orders, choose_rows, resonance_peaks
from identification.modes import Modes
from identification.recording import Array, Recording
from identification.systems import Realization, StateSpace


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
        n_rows: block rows of the Hankel matrix, so that lags 1 to 2 `n_rows` - 1 are used; two thirds
            of a period of the lowest resonance peak when None.
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
    rows = reference_rows(recording, references)
    sweep = order is None and orders is None
    plan = _plan(recording, _sorted_orders(order, orders), n_rows, rows.size)
    R = output_covariances(recording, plan.n_lags, references=references)
    scale = _balance(R, recording, rows)
    past = range(0, plan.stride * plan.n_columns, plan.stride)
    H = np.hstack([R[lag : lag + plan.n_rows].reshape(-1, rows.size) for lag in past])
    del R
    U, singular_values = leading_subspace(H, plan.orders[-1] + 2)
    rank = int(np.sum(singular_values > np.finfo(float).eps * max(H.shape) * singular_values[0]))
    del H
    wanted = [n for n in plan.orders if n <= rank] if sweep else plan.orders
    if not wanted or wanted[-1] > rank:
        raise OrderError(
            f"order {plan.orders[-1]} exceeds {rank}, the numerical rank of the covariances; "
            "lower the order, or check the channels where the rank is zero"
        )
    systems = tuple(
        _outputs_only(A, C * scale, recording)
        for A, C in shift_invariance(U, singular_values, n_outputs=len(scale), orders=wanted)
    )
    notes = plan.notes
    if order is None:
        order = _largest_gap(singular_values, wanted)
        notes += (f"The singular values drop most steeply after the first {order}.",)
    realization = Realization("ssi_cov", systems, singular_values, order, plan.settings(), notes)
    return replace(realization, notes=(*notes, *horizon_warning(realization.system.modes(), realization)))


class _Plan(NamedTuple):
    """Orders to realize, and the Hankel matrix to realize them from: its columns begin at every `stride`th lag."""

    orders: list[int]
    n_rows: int
    n_columns: int
    stride: int
    n_references: int
    notes: tuple[str, ...]

    @property
    def n_lags(self) -> int:
        return self.n_rows + self.stride * (self.n_columns - 1)

    def settings(self) -> dict[str, int | float | str]:
        names = ("n_rows", "n_columns", "stride", "n_references")
        return {name: getattr(self, name) for name in names}


def _plan(recording: Recording, orders: list[int], n_rows: int | None, n_references: int) -> _Plan:
    """What is left open, chosen from the data."""
    notes: list[str] = []
    sweep = not orders
    peaks = resonance_peaks(recording) if sweep or n_rows is None else []
    if sweep:
        orders, reason = choose_orders(recording, len(peaks))
        notes.append(reason)
    if n_rows is None:
        n_rows, reason = choose_rows(recording, peaks, orders[-1], n_references)
        notes.append(reason)
    elif n_rows < 2:
        raise IdentificationError(f"{n_rows} block rows were asked for; expected at least 2")
    stride = -(-n_rows * n_references // MAX_COLUMNS)
    n_columns = -(-n_rows // stride)
    if stride > 1:
        notes.append(f"The past enters at one lag in {stride}, as neighbouring ones tell nearly the same.")
    largest = min((n_rows - 1) * len(recording.outputs), n_columns * n_references)
    if sweep:
        orders = [n for n in orders if n <= largest] or orders[:1]
    if orders[-1] > largest:
        raise OrderError(
            f"order {orders[-1]} exceeds {largest}, the most that {n_rows} block rows of {len(recording.outputs)} "
            f"outputs with {n_references} references carry; lower the order or take more block rows"
        )
    return _Plan(orders, n_rows, n_columns, stride, n_references, tuple(notes))


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


def _sorted_orders(order: int | None, orders: Iterable[int] | None) -> list[int]:
    """Orders asked for, rising; empty when the data are to decide."""
    wanted = sorted({*(() if orders is None else orders), *(() if order is None else (order,))})
    if (orders is not None and not wanted) or any(n < 1 for n in wanted):
        raise OrderError(f"orders are {wanted}; expected whole numbers from 1 on")
    return wanted


def horizon_warning(modes: Modes, realization: Realization) -> tuple[str, ...]:
    """One sentence when the horizon is shorter than a third of a period of the slowest light mode, or none."""
    light = modes.frequency_hz[(modes.damping_ratio > 0) & (modes.damping_ratio < 0.3)]
    if not light.size:
        return ()
    n_rows, rate = int(realization.settings["n_rows"]), 1 / realization.system.dt
    if 3 * n_rows * light[0] >= rate:
        return ()
    return (
        f"{n_rows} block rows span less than a third of a period of the mode at {light[0]:.4g} Hz, which is "
        f"then mostly noise; take about {math.ceil(2 / 3 * rate / light[0])} block rows.",
    )


def _balance(R: Array, recording: Recording, rows: NDArray[np.intp]) -> Array:
    """Bring outputs of different units to one scale, in place; gives that scale, shape (n_outputs, 1).

    Without it the choice of a unit would decide which outputs the truncated subspace follows. Outputs of
    one unit share a scale, because among them the size of a signal does tell its weight against the noise.
    """
    units = np.array([channel.unit for channel in recording.outputs])
    scale, reference_scale = np.ones(units.size), np.ones(rows.size)
    if np.all(units == units[0]):
        return scale[:, None]
    for unit in set(units[rows]):
        outs, refs = units == unit, units[rows] == unit
        scale[outs] = reference_scale[refs] = np.sqrt(np.linalg.norm(R[:, outs][:, :, refs])) or 1.0
    R /= reference_scale
    for unit in set(units) - set(units[rows]):
        scale[units == unit] = np.linalg.norm(R[:, units == unit]) or 1.0
    R /= scale[:, None]
    return scale[:, None]


def _largest_gap(singular_values: Array, orders: Sequence[int]) -> int:
    """The order after which the singular values fall by the largest factor."""
    s = np.maximum(singular_values, np.finfo(float).tiny)
    n = np.array([order for order in orders if order < s.size] or orders[:1])
    return int(n[np.argmax(s[n - 1] / s[np.minimum(n, s.size - 1)])])
