"""Ibrahim time domain and its multiple-reference forms: modes as the eigenvectors of a shifted Hankel matrix.

In complex form each method gives eigenvalues, mode shapes and participations, Y(k) = Ψ Λᵏ L. In real
form MRTD is the output-normal and MMRTD the input-normal realization of `era`, found by another
computation; powers of Σ take one form into another. Letters and equations as in Juang (1992), thesis,
chapters 4 and 5 and appendix C.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import scipy.linalg

from identification.era import FORMS, Decomposition, decompose, hankel_size, settle_orders
from identification.errors import IdentificationError
from identification.hankel import numerical_rank
from identification.modal_realization import ModalRealization
from identification.recording import Array
from identification.systems import MarkovParameters, Realization, StateSpace


def itd(
    markov: MarkovParameters,
    order: int | None = None,
    *,
    n_rows: int | None = None,
    n_columns: int | None = None,
) -> ModalRealization:
    """Modes by the Ibrahim time domain method: eigenvectors of H(1) H(0)⁺, as many as H(0) has rank.

    Args:
        markov: D, CB, CAB, …, shape (n_lags, n_outputs, n_inputs).
        order: rank to which H(0) is cut; its numerical rank when None, as in the original method, which
            leaves noise in full.
        n_rows: as for `era`.
        n_columns: as for `era`.

    Returns:
        Poles, shapes and participations, Y(k) = Ψ Λᵏ L.

    Raises:
        OrderError: `order` exceeds the numerical rank.
        TooShortError: too few lags.

    Source: Juang (1992), thesis, eq. (4.8) to (4.11); Ibrahim and Mikulcik (1977), Shock Vib. Bull. 47(4).
    """
    n_rows, n_columns = hankel_size(markov, n_rows, n_columns)
    H = decompose(markov, n_rows, n_columns)
    if order is None:
        order = numerical_rank(H.S, H.H0.shape)
    settle_orders(markov, H, order, None)
    E = ((H.H1 @ H.Q[:, :order]) / H.S[:order]) @ H.P[:, :order].T
    z, Psi_bar = scipy.linalg.eig(E)
    # The matrix has rank `order`; its other eigenvalues are zero.
    keep = np.argsort(-np.abs(z), kind="stable")[:order]
    L_bar = np.linalg.lstsq(Psi_bar[:, keep], H.H0[:, : len(markov.inputs)].astype(complex), rcond=None)[0]
    return ModalRealization.sorted(z[keep], Psi_bar[: len(markov.outputs), keep], L_bar, markov)


def mrtd(
    markov: MarkovParameters,
    order: int | None = None,
    *,
    n_rows: int | None = None,
    n_columns: int | None = None,
) -> ModalRealization:
    """Modes by the multiple-reference time domain method: Ibrahim's within the leading left subspace.

    Args:
        markov: as for `itd`.
        order: number of states; chosen from the singular values when None.
        n_rows: as for `era`.
        n_columns: as for `era`.

    Returns:
        Poles, shapes and participations, Y(k) = Ψ Λᵏ L.

    Raises:
        OrderError: `order` exceeds the numerical rank.
        TooShortError: too few lags.

    Source: Juang (1992), thesis, eq. (4.27), (4.29), (4.32) and (4.33).
    """
    system = mrtd_real(markov, order, n_rows=n_rows, n_columns=n_columns).system
    z, Psi_n = scipy.linalg.eig(system.A)
    L = np.linalg.solve(Psi_n, system.B.astype(complex))
    return ModalRealization.sorted(z, system.C @ Psi_n, L, markov)


def mmrtd(
    markov: MarkovParameters,
    order: int | None = None,
    *,
    n_rows: int | None = None,
    n_columns: int | None = None,
) -> ModalRealization:
    """Modes by the modified multiple-reference method: participations first, from the leading right subspace.

    Args:
        markov: as for `itd`.
        order: number of states; chosen from the singular values when None.
        n_rows: as for `era`.
        n_columns: as for `era`.

    Returns:
        Poles, shapes and participations, Y(k) = Ψ Λᵏ L.

    Raises:
        OrderError: `order` exceeds the numerical rank.
        TooShortError: too few lags.

    Source: Juang (1992), thesis, eq. (4.64), (4.67), (4.70) and (4.71).
    """
    system = mmrtd_real(markov, order, n_rows=n_rows, n_columns=n_columns).system
    z, L_n = scipy.linalg.eig(system.A.T)  # L_n transposed
    Psi = np.linalg.solve(L_n, system.C.T.astype(complex)).T
    return ModalRealization.sorted(z, Psi, L_n.T @ system.B, markov)


def mrtd_real(
    markov: MarkovParameters,
    order: int | None = None,
    *,
    n_rows: int | None = None,
    n_columns: int | None = None,
    orders: Iterable[int] | None = None,
) -> Realization:
    """State space by MRTD, [E, F, G]: the least-squares shift between the projections Pᵀ H(0) and Pᵀ H(1).

    Args:
        markov: as for `itd`.
        order: number of states; chosen from the singular values when None.
        n_rows: as for `era`.
        n_columns: as for `era`.
        orders: further orders to realize.

    Returns:
        Models of all orders asked for, and all singular values of H(0).

    Raises:
        OrderError: an order exceeds the numerical rank.
        TooShortError: too few lags.

    Source: Juang (1992), thesis, eq. (4.23), (4.27) and (5.2).
    """

    def realize(H: Decomposition, n: int) -> tuple[Array, Array, Array]:
        P = H.P[:, :n]
        H0, H1 = P.T @ H.H0, P.T @ H.H1
        return _shift(H0, H1), H0[:, : len(markov.inputs)], P[: len(markov.outputs)]

    return _realized("mrtd", realize, markov, order, n_rows, n_columns, orders)


def mmrtd_real(
    markov: MarkovParameters,
    order: int | None = None,
    *,
    n_rows: int | None = None,
    n_columns: int | None = None,
    orders: Iterable[int] | None = None,
) -> Realization:
    """State space by MMRTD, [E_m, F_m, G_m]: the same with the projections Qᵀ H(0)ᵀ and Qᵀ H(1)ᵀ.

    Args:
        markov: as for `itd`.
        order: number of states; chosen from the singular values when None.
        n_rows: as for `era`.
        n_columns: as for `era`.
        orders: further orders to realize.

    Returns:
        Models of all orders asked for, and all singular values of H(0).

    Raises:
        OrderError: an order exceeds the numerical rank.
        TooShortError: too few lags.

    Source: Juang (1992), thesis, eq. (4.59), (4.64) and (5.4).
    """

    def realize(H: Decomposition, n: int) -> tuple[Array, Array, Array]:
        Q = H.Q[:, :n]
        H0, H1 = Q.T @ H.H0.T, Q.T @ H.H1.T
        return _shift(H0, H1).T, Q[: len(markov.inputs)].T, H0[:, : len(markov.outputs)].T

    return _realized("mmrtd", realize, markov, order, n_rows, n_columns, orders)


def change_of_form(singular_values: Array, order: int, source: str, target: str) -> Array:
    """T with A_target = T A_source T⁻¹, B_target = T B_source, C_target = C_source T⁻¹, shape (order, order).

    Args:
        singular_values: of the Hankel matrix, largest first.
        order: number of states.
        source: one of `FORMS`; MRTD is output_normal, MMRTD is input_normal.
        target: likewise.

    Returns:
        The diagonal matrix of powers of Σ.

    Raises:
        IdentificationError: a form is unknown.

    Source: Juang (1992), thesis, eq. (5.6) to (5.8): powers of Σ.
    """
    unknown = [form for form in (source, target) if form not in FORMS]
    if unknown:
        raise IdentificationError(f"form {unknown[0]!r} is unknown; expected one of {', '.join(FORMS)}")
    return np.diag(np.asarray(singular_values[:order]) ** (FORMS[target] - FORMS[source]))


def _shift(H0: Array, H1: Array) -> Array:
    """H(1) H(0)⁺ by orthogonal factorization, which spares the squares that eq. (4.26) would form."""
    return np.asarray(np.linalg.lstsq(H0.T, H1.T, rcond=None)[0].T)


def _realized(
    method: str,
    realize: Callable[[Decomposition, int], tuple[Array, Array, Array]],
    markov: MarkovParameters,
    order: int | None,
    n_rows: int | None,
    n_columns: int | None,
    orders: Iterable[int] | None,
) -> Realization:
    n_rows, n_columns = hankel_size(markov, n_rows, n_columns)
    H = decompose(markov, n_rows, n_columns)
    order, wanted, notes = settle_orders(markov, H, order, orders)
    systems = tuple(
        StateSpace(*realize(H, n), markov.values[0], markov.dt, markov.inputs, markov.outputs) for n in wanted
    )
    return Realization(method, systems, H.S, order, {"n_rows": n_rows, "n_columns": n_columns}, notes)
