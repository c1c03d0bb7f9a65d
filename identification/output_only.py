"""What output-only subspace methods share: the Hankel matrix they need, and the models that it gives."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.linalg

from identification.errors import IdentificationError, OrderError
from identification.hankel import shift_invariance
from identification.horizon import MAX_COLUMNS, choose_orders, choose_rows, resonance_peaks
from identification.modes import Modes
from identification.recording import Array, Recording
from identification.systems import Realization, StateSpace


class Plan(NamedTuple):
    """Orders to realize, and the Hankel matrix to realize them from.

    Attributes:
        orders: rising.
        swept: whether the data, not the caller, set the orders.
        n_rows: block rows: the future.
        n_columns: block columns: the past.
        stride: lags from one block column to the next.
        n_references: references in a block column.
        notes: what was chosen and why.
    """

    orders: list[int]
    swept: bool
    n_rows: int
    n_columns: int
    stride: int
    n_references: int
    notes: tuple[str, ...]

    @property
    def past(self) -> range:
        """Lags at which the block columns begin."""
        return range(0, self.stride * self.n_columns, self.stride)

    def settings(self) -> dict[str, int | float | str]:
        """The horizon, by name."""
        names = ("n_rows", "n_columns", "stride", "n_references")
        return {name: getattr(self, name) for name in names}


def plan_hankel(
    recording: Recording,
    order: int | None,
    orders: Iterable[int] | None,
    n_rows: int | None,
    n_references: int,
) -> Plan:
    """The plan with what is None chosen from the data.

    Args:
        recording: whose outputs are realized.
        order: as asked; None to choose.
        orders: further ones; likewise.
        n_rows: block rows; likewise.
        n_references: references in a block column.

    Returns:
        Orders and horizon, with the reasons.

    Raises:
        OrderError: an order below 1, or above what the Hankel matrix can carry.
        IdentificationError: fewer than two block rows.
    """
    notes: list[str] = []
    wanted = _sorted_orders(order, orders)
    sweep = not wanted
    peaks = resonance_peaks(recording) if sweep or n_rows is None else []
    if sweep:
        wanted, reason = choose_orders(recording, len(peaks))
        notes.append(reason)
    if n_rows is None:
        n_rows, reason = choose_rows(recording, peaks, wanted[-1], n_references)
        notes.append(reason)
    elif n_rows < 2:
        raise IdentificationError(f"{n_rows} block rows were asked for; expected at least 2")
    stride = -(-n_rows * n_references // MAX_COLUMNS)
    n_columns = -(-n_rows // stride)
    if stride > 1:
        notes.append(f"The past enters at one lag in {stride}, as neighbouring ones tell nearly the same.")
    largest = min((n_rows - 1) * len(recording.outputs), n_columns * n_references)
    if sweep:
        wanted = [n for n in wanted if n <= largest] or wanted[:1]
    if wanted[-1] > largest:
        raise OrderError(
            f"order {wanted[-1]} exceeds {largest}, the most that {n_rows} block rows of {len(recording.outputs)} "
            f"outputs with {n_references} references carry; lower the order or take more block rows"
        )
    return Plan(wanted, sweep, n_rows, n_columns, stride, n_references, tuple(notes))


def realized(
    method: str,
    recording: Recording,
    order: int | None,
    plan: Plan,
    H: Array,
    scale: Array,
) -> Realization:
    """Models of every order of the plan, from the leading left subspace of a matrix O X.

    Args:
        method: name of the method.
        recording: where the outputs come from.
        order: the one to choose; where the singular values drop most steeply when None.
        plan: orders and horizon.
        H: product of the observability matrix O and something else, (n_rows * n_outputs, n_columns *
            n_references).
        scale: what the outputs were divided by, shape (n_outputs, 1).

    Returns:
        Models without inputs.

    Raises:
        OrderError: an order exceeds the rank of H.

    Source: as for `shift_invariance`.
    """
    U, singular_values = leading_subspace(H, plan.orders[-1] + 2)
    wanted = orders_within_rank(plan, singular_values, H.shape)
    systems = shift_invariance(U, singular_values, n_outputs=len(scale), orders=wanted)
    return gathered(method, recording, order, plan, singular_values, [(A, C * scale) for A, C in systems])


def past_and_future(R: Array, plan: Plan) -> Array:
    """Covariances below each other, from every lag of the past on, (n_rows * n_outputs, n_columns * n_references).

    Args:
        R: covariances from the first lag wanted on, shape (n_lags, n_outputs, n_references).
        plan: the horizon.

    Returns:
        The Hankel matrix, a block column per lag of the past.

    Source: Cambraia and Kurka (2010), VI CONEM, eq. (29), with the block columns in reverse order.
    """
    return np.hstack([R[lag : lag + plan.n_rows].reshape(-1, R.shape[2]) for lag in plan.past])


def orders_within_rank(plan: Plan, singular_values: Array, shape: tuple[int, ...]) -> list[int]:
    """The orders of the plan that the data carry; the caller's own ones must be among them.

    Args:
        plan: orders wanted.
        singular_values: of the Hankel matrix, largest first.
        shape: of the Hankel matrix.

    Returns:
        Rising.

    Raises:
        OrderError: an order exceeds the numerical rank.
    """
    rank = int(np.sum(singular_values > np.finfo(float).eps * max(shape) * singular_values[0]))
    wanted = [n for n in plan.orders if n <= rank] if plan.swept else plan.orders
    if not wanted or wanted[-1] > rank:
        raise OrderError(
            f"order {plan.orders[-1]} exceeds {rank}, the numerical rank of the outputs; "
            "lower the order, or check the channels where the rank is zero"
        )
    return wanted


def gathered(
    method: str,
    recording: Recording,
    order: int | None,
    plan: Plan,
    singular_values: Array,
    models: Sequence[tuple[Array, Array]],
) -> Realization:
    """The realization made of A and C of every order, with the order chosen where the caller left it open.

    Args:
        method: name of the method.
        recording: where the outputs come from.
        order: the one to choose; where the singular values drop most steeply when None.
        plan: orders and horizon.
        singular_values: of the Hankel matrix, largest first.
        models: A and C of every order.

    Returns:
        Models without inputs.
    """
    systems = tuple(_outputs_only(A, C, recording) for A, C in models)
    notes = plan.notes
    if order is None:
        order = _largest_gap(singular_values, [system.n_states for system in systems])
        notes += (f"The singular values drop most steeply after the first {order}.",)
    found = Realization(method, systems, singular_values, order, plan.settings(), notes)
    return replace(found, notes=(*notes, *horizon_warning(found.system.modes(), found)))


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
    # All of them by divide and conquer cost less than many.
    few = {"driver": "evr", "subset_by_index": (small - n, small - 1)} if 6 * n < small else {"driver": "evd"}
    w, V = scipy.linalg.eigh(G, overwrite_a=True, check_finite=False, **few)
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
    """One sentence when the horizon is shorter than half a period of the slowest light mode, or none.

    Args:
        modes: those found.
        realization: from a Hankel matrix, with its size in the settings; calculated data need no longer horizon.

    Returns:
        At most one warning.

    Source: Reynders and De Roeck (2008), Mech. Syst. Signal Process. 22(3), the least number of block rows.
    """
    light = modes.frequency_hz[(modes.damping_ratio > 0) & (modes.damping_ratio < 0.3)]
    s, order = realization.singular_values, realization.order
    if not light.size or (order < s.size and s[order] <= 1e-8 * s[0]):
        return ()
    settings, rate = realization.settings, 1 / realization.system.dt
    n_columns = int(settings["n_columns"]) * int(settings.get("stride", 1))
    n, what = min((int(settings["n_rows"]), "rows"), (n_columns, "columns"))
    if 2 * n * light[0] >= rate:
        return ()
    return (
        f"{n} block {what} span less than half a period of the mode at {light[0]:.4g} Hz, which is "
        f"then mostly noise; take about {math.ceil(2 / 3 * rate / light[0])} block {what}.",
    )


def _largest_gap(singular_values: Array, orders: Sequence[int]) -> int:
    """The order after which the singular values fall by the largest factor."""
    s = np.maximum(singular_values, np.finfo(float).tiny)
    n = np.array([order for order in orders if order < s.size] or orders[:1])
    return int(n[np.argmax(s[n - 1] / s[np.minimum(n, s.size - 1)])])
