"""Natural excitation technique: correlations of random responses, realized as if they were free decays.

Under white excitation the covariances R_k, k >= 1, are free decays of the structure, one for each reference.
R_0 is not: it carries the noise of the sensors, and stays out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from identification.covariance import output_covariances, reference_rows
from identification.errors import OrderError
from identification.output_only import leading_subspace, plan_hankel
from identification.recording import Array, Recording
from identification.ssi import balance
from identification.systems import Realization, StateSpace


def next_era(
    recording: Recording,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    n_rows: int | None = None,
    references: Sequence[str] | None = None,
) -> Realization:
    """Models of every order from the covariances of the outputs with references, by ERA (NExT-ERA).

    Args:
        recording: outputs of a structure under random excitation, measured or not; inputs are not used.
        order: number of states of the model to choose; the largest gap of the singular values decides when
            None.
        orders: orders to realize besides `order`; chosen from the spectra when both are None.
        n_rows: block rows of the Hankel matrix; chosen from the lowest resonance when None.
        references: names of the reference outputs, each of which gives a free decay; all when None.

    Returns:
        The models, without inputs, and all singular values.

    Raises:
        OrderError: an order below 1, or above what the Hankel matrix can carry.
        TooShortError: the record has fewer samples than lags.
        RecordingError: a reference does not exist, or a sample is missing.

    Source: James, Carne and Lauffer (1995), Int. J. Anal. Exp. Modal Anal. 10(4), 260-277; realized as in
        Juang and Pappa (1985), J. Guidance 8(5).
    """
    rows = reference_rows(recording, references)
    plan = plan_hankel(recording, order, orders, n_rows, rows.size)
    R = output_covariances(recording, plan.n_rows + plan.past[-1] + 1, references=references)
    scale = balance(R, recording, rows)  # (n_outputs, 1)
    H0, H1 = (_hankel(R[lag:], plan.n_rows, plan.past) for lag in (0, 1))
    U, singular_values = leading_subspace(H0, plan.orders[-1] + 2)
    wanted = _within_rank(plan.orders, singular_values, H0.shape, swept=plan.swept)
    P, S = U[:, : wanted[-1]], singular_values[: wanted[-1]]
    Q = H0.T @ P / S
    root = np.sqrt(S)
    A = P.T @ H1 @ Q / root[:, None] / root  # nested: order n is the leading block
    C = scale * P[: len(scale)] * root
    n_outputs, notes = len(scale), plan.notes
    if order is None:
        order = _steepest_drop(singular_values, wanted)
        notes += (f"The singular values drop most steeply after the first {order}.",)
    systems = tuple(
        StateSpace(
            A[:n, :n],
            np.zeros((n, 0)),
            C[:, :n],
            np.zeros((n_outputs, 0)),
            recording.dt,
            (),
            recording.outputs,
        )
        for n in wanted
    )
    return Realization("next_era", systems, singular_values, order, plan.settings(), notes)


def _hankel(R: Array, n_rows: int, past: range) -> Array:
    """Free decays below each other, from every lag of the past on, (n_rows * n_outputs, n_past * n_references)."""
    return np.hstack([R[lag : lag + n_rows].reshape(-1, R.shape[2]) for lag in past])


def _within_rank(orders: list[int], s: Array, shape: tuple[int, ...], *, swept: bool) -> list[int]:
    """The orders that the data carry; the caller's own ones must be among them."""
    rank = int(np.sum(s > np.finfo(float).eps * max(shape) * s[0]))
    kept = [n for n in orders if n <= rank]
    if not kept or (not swept and kept != orders):
        raise OrderError(
            f"order {orders[-1]} exceeds {rank}, the numerical rank of the covariances; "
            "lower the order, or check the channels where the rank is zero"
        )
    return kept


def _steepest_drop(s: Array, orders: list[int]) -> int:
    """The order after which the singular values fall by the largest factor."""
    floor = np.finfo(float).eps * s[0]
    n = np.array([order for order in orders if order < s.size] or orders[:1])
    return int(n[np.argmax(s[n - 1] / np.maximum(s[np.minimum(n, s.size - 1)], floor))])
