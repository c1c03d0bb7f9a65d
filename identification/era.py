"""Eigensystem realization: from pulse responses or free decays to state-space models of any order."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import scipy.linalg

from identification.errors import IdentificationError, OrderError, TooShortError
from identification.hankel import block_hankel, choose_order, numerical_rank
from identification.recording import Array
from identification.systems import MarkovParameters, Realization, StateSpace

FORMS = {"input_normal": 0.0, "balanced": 0.5, "output_normal": 1.0}
"""The power of Σ that goes to the controllability matrix; the rest goes to the observability matrix."""


class Decomposition(NamedTuple):
    """H(0) = P Σ Qᵀ and H(1), the same matrix one sample later.

    Attributes:
        H0: shape (n_rows * n_outputs, n_columns * n_inputs); lag 1 stands in the top left block.
        H1: likewise, from lag 2 on.
        P: left singular vectors, in columns.
        S: singular values, largest first.
        Q: right singular vectors, in columns.
    """

    H0: Array
    H1: Array
    P: Array
    S: Array
    Q: Array


def era(
    markov: MarkovParameters,
    order: int | None = None,
    *,
    form: str = "balanced",
    n_rows: int | None = None,
    n_columns: int | None = None,
    orders: Iterable[int] | None = None,
) -> Realization:
    """State space whose impulse response matches the Markov parameters, in one of three normal forms.

    All three are the same system. With Hankel matrices that grow without end, the Grammians of
    controllability and observability tend to I and Σ² (input_normal), Σ and Σ (balanced), Σ² and I
    (output_normal).

    Args:
        markov: D, CB, CAB, …, shape (n_lags, n_outputs, n_inputs).
        order: number of states; chosen from the singular values when None, with the reason in the notes.
        form: one of `FORMS`.
        n_rows: block rows of the Hankel matrix.
        n_columns: block columns. What is None is chosen so that all lags are used where that is affordable.
        orders: further orders to realize from the same decomposition.

    Returns:
        Models of all orders asked for, and all singular values.

    Raises:
        OrderError: an order exceeds the numerical rank of the Hankel matrix.
        TooShortError: too few lags for the rows and columns asked for.
        IdentificationError: `form` is unknown.

    Source: Juang (1992), thesis, eq. (3.10), (3.15), (3.20); after Juang and Pappa (1985), J. Guidance 8(5).
    """
    if form not in FORMS:
        raise IdentificationError(f"form {form!r} is unknown; expected one of {', '.join(FORMS)}")
    n_rows, n_columns = hankel_size(markov, n_rows, n_columns)
    H = decompose(markov, n_rows, n_columns)
    order, wanted, notes = settle_orders(markov, H, order, orders)
    n_max = wanted[-1]
    P, S, Q = H.P[:, :n_max], H.S[:n_max], H.Q[:, :n_max]
    core = P.T @ H.H1 @ Q  # (n_max, n_max), nested: order n is its leading block
    to_B = S ** FORMS[form]
    to_C = S ** (1 - FORMS[form])
    n_outputs, n_inputs = len(markov.outputs), len(markov.inputs)
    A = core / to_C[:, None] / to_B
    B = to_B[:, None] * Q[:n_inputs].T
    C = P[:n_outputs] * to_C
    systems = tuple(
        StateSpace(A[:n, :n], B[:n], C[:, :n], markov.values[0], markov.dt, markov.inputs, markov.outputs)
        for n in wanted
    )
    settings: dict[str, int | float | str] = {"form": form, "n_rows": n_rows, "n_columns": n_columns}
    return Realization("era", systems, H.S, order, settings, notes)


def era_dc(
    markov: MarkovParameters,
    order: int | None = None,
    *,
    n_rows: int | None = None,
    n_columns: int | None = None,
    n_shifts: int = 10,
    step: int | None = None,
    first: int = 0,
    orders: Iterable[int] | None = None,
) -> Realization:
    """State space by data correlations: the realization of R(k) = H(k) H(0)ᵀ, which averages noise.

    Squaring the data costs half the digits of weak modes when there is no noise; `era` keeps them.

    Args:
        markov: D, CB, CAB, …, shape (n_lags, n_outputs, n_inputs).
        order: number of states; chosen from the singular values of H(0) when None, with the reason in
            the notes.
        n_rows: block rows of H(k); what makes about 60 rows when None.
        n_columns: block columns of H(k); all that the lags allow when None.
        n_shifts: block rows and columns of the Hankel matrix of correlations, ξ + 1 and ζ + 1 in the paper.
        step: samples between the correlations, τ in the paper; what spans half the lags when None.
        first: k of the first correlation; from `n_rows` on, white noise leaves no bias.
        orders: further orders to realize from the same decomposition.

    Returns:
        Models of all orders asked for in balanced coordinates, and all singular values of the correlations.

    Raises:
        OrderError: an order exceeds the numerical rank.
        TooShortError: too few lags.

    Source: Juang, Cooper and Wright (1988), Control Theory Adv. Technol. 4(1), 5-14: with U(k) the block
        Hankel matrix of R(k + i τ + j τ), U(0) = P Σ Qᵀ and A = Σ^-½ Pᵀ U(1) Q Σ^-½; C and B from its first
        block row and from [P Σ^½]⁺ H(0).
    """
    n_outputs, n_inputs = len(markov.outputs), len(markov.inputs)
    if step is None:
        step = max(1, markov.n_lags // 2 // (2 * n_shifts - 1))
    lags = range(first, first + step * (2 * n_shifts - 1), step)
    last = lags[-1] + 1
    room = markov.n_lags - 1 - last
    if n_rows is None:
        n_rows = max(1, min(-(-60 // n_outputs), room // 2))
    if n_columns is None:
        n_columns = room - n_rows + 1
    if n_columns < 1 or n_rows + n_columns - 1 > room:
        raise TooShortError(
            f"{markov.n_lags} lags cannot fill {n_rows} x {max(n_columns, 1)} blocks at {last} shifts; "
            "lengthen the record or lower n_rows, n_columns, n_shifts, step or first"
        )

    def correlation(k: int) -> Array:
        return block_hankel(markov.values, n_rows, n_columns, first=1 + k) @ H0.T

    H0 = block_hankel(markov.values, n_rows, n_columns, first=1)
    U0, U1 = (
        block_hankel(np.stack([correlation(k + shift) for k in lags]), n_shifts, n_shifts) for shift in (0, 1)
    )
    P, S, Qt = scipy.linalg.svd(U0, full_matrices=False)
    H = Decomposition(H0, H0, *_svd(H0))
    order, wanted, notes = settle_orders(markov, H, order, orders)
    n_max = wanted[-1]
    root = np.sqrt(S[:n_max])
    A = P[:, :n_max].T @ U1 @ Qt[:n_max].T / root[:, None] / root
    O_n = P[: H0.shape[0], :n_max] * root
    # B = O⁺ H(0) at each order, from one factorization nested over all of them.
    q, r = scipy.linalg.qr(O_n, mode="economic")
    x = q.T @ H0[:, :n_inputs]
    systems = tuple(
        StateSpace(
            A[:n, :n],
            scipy.linalg.solve_triangular(r[:n, :n], x[:n]),
            O_n[:n_outputs, :n],
            markov.values[0],
            markov.dt,
            markov.inputs,
            markov.outputs,
        )
        for n in wanted
    )
    settings: dict[str, int | float | str] = {
        "n_rows": n_rows,
        "n_columns": n_columns,
        "n_shifts": n_shifts,
        "step": step,
        "first": first,
    }
    return Realization("era_dc", systems, S, order, settings, notes)


def decompose(markov: MarkovParameters, n_rows: int, n_columns: int) -> Decomposition:
    """The Hankel matrices H(0) and H(1) and the singular value decomposition of the first.

    The decomposition is the exact one: that of H Hᵀ is cheaper and loses half the digits of weak modes.

    Args:
        markov: D, CB, CAB, …, shape (n_lags, n_outputs, n_inputs).
        n_rows: block rows.
        n_columns: block columns.

    Returns:
        Both matrices, and P, Σ and Q of the first.

    Raises:
        TooShortError: too few lags.

    Source: Juang (1992), thesis, eq. (2.24) and (3.1).
    """
    H = block_hankel(markov.values, n_rows, n_columns + 1, first=1)
    n_inputs = len(markov.inputs)
    H0, H1 = H[:, :-n_inputs], H[:, n_inputs:]
    return Decomposition(H0, H1, *_svd(H0))


def _svd(H: Array) -> tuple[Array, Array, Array]:
    P, S, Qt = scipy.linalg.svd(H, full_matrices=False)
    return P, S, Qt.T


def hankel_size(markov: MarkovParameters, n_rows: int | None, n_columns: int | None) -> tuple[int, int]:
    """Block rows and columns: as asked, or such that all lags are used at a bearable cost.

    Args:
        markov: the responses.
        n_rows: as asked; None to choose.
        n_columns: likewise.

    Returns:
        Block rows and block columns.

    Raises:
        TooShortError: too few lags.
        IdentificationError: no inputs or no outputs.
    """
    if not markov.inputs or not markov.outputs:
        raise IdentificationError(
            f"{len(markov.outputs)} outputs and {len(markov.inputs)} inputs make no Hankel matrix; "
            f"expected at least "
            "one of each"
        )
    lags = markov.n_lags - 1  # lag 0 is D; H(1) ends one lag later than H(0)
    if n_columns is None:
        n_columns = lags - n_rows if n_rows else max(1, min(lags // 2, 500 // len(markov.inputs)))
        if n_rows is None:
            n_rows = max(1, min(lags - n_columns, 4000 // len(markov.outputs)))
    if n_rows is None:
        n_rows = lags - n_columns
    if min(n_rows, n_columns) < 1 or n_rows + n_columns > lags:
        raise TooShortError(
            f"{markov.n_lags} lags cannot fill Hankel matrices of {n_rows} x {n_columns} blocks; "
            f"block rows and columns together may be {max(lags, 0)} at most"
        )
    return n_rows, n_columns


def settle_orders(
    markov: MarkovParameters, H: Decomposition, order: int | None, orders: Iterable[int] | None
) -> tuple[int, list[int], tuple[str, ...]]:
    """The order (chosen when None), all orders to realize by rising size, and the reason for the choice.

    Args:
        markov: the responses.
        H: the Hankel matrix in its singular values.
        order: as asked; None to choose.
        orders: further ones.

    Returns:
        The order, all orders, and sentences on the choice.

    Raises:
        OrderError: an order exceeds the numerical rank.
    """
    notes: tuple[str, ...] = ()
    if order is None:
        order, note = choose_order(H.P, H.S, H.Q, n_outputs=len(markov.outputs), n_inputs=len(markov.inputs))
        notes = (note,)
    singular_values, shape = H.S, H.H0.shape
    wanted = sorted({order, *(orders or ())})
    rank = numerical_rank(singular_values, shape)
    if wanted[0] < 1 or wanted[-1] > rank:
        wrong = wanted[0] if wanted[0] < 1 else wanted[-1]
        raise OrderError(
            f"order {wrong} is outside 1 to {rank}, the numerical rank of the "
            f"{shape[0]} x {shape[1]} Hankel matrix; lower the order or lengthen the record"
        )
    return order, wanted, notes
