"""Block Hankel matrices, and the state-space models that a subspace of observability gives at every order.

Matrices Y_0, Y_1, … that obey Y_k = C Aᵏ X have a Hankel matrix H = O [X, AX, …] with O = [C; CA; CA²; …].
Its leading left singular vectors U span the columns of O, and U without its last block row differs from U
without its first one by A alone.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy.linalg

from identification.errors import OrderError, TooShortError
from identification.recording import Array


def block_hankel(values: Array, n_rows: int, n_columns: int, *, first: int = 0) -> Array:
    """Block Hankel matrix with block (i, j) = values[first + i + j].

    Args:
        values: a matrix per lag, shape (n_lags, n_outputs, n_inputs).
        n_rows: block rows.
        n_columns: block columns.
        first: lag of the top left block.

    Returns:
        Shape (n_rows * n_outputs, n_columns * n_inputs).

    Raises:
        TooShortError: the last block would need a lag that is not there.

    Source: Juang (1992), thesis, eq. (2.20); Juang and Pappa (1985), J. Guidance 8(5).
    """
    n_lags, n_outputs, n_inputs = values.shape
    if first + n_rows + n_columns - 1 > n_lags:
        raise TooShortError(
            f"a Hankel matrix of {n_rows} x {n_columns} blocks from lag {first} on needs "
            f"{first + n_rows + n_columns - 1} lags and {n_lags} were given; take fewer rows or columns"
        )
    windows = np.lib.stride_tricks.sliding_window_view(values[first:], n_columns, axis=0)[:n_rows]
    # (n_rows, n_outputs, n_inputs, n_columns), the last axis counting the columns
    return np.ascontiguousarray(windows.transpose(0, 1, 3, 2)).reshape(
        n_rows * n_outputs, n_columns * n_inputs
    )


def shift_invariance(
    U: Array, singular_values: Array, *, n_outputs: int, orders: Iterable[int]
) -> list[tuple[Array, Array]]:
    """State matrix A and output matrix C of each order, from one factorization of the leading left subspace.

    The observability matrix of order n is O_n = U_n S_n^½. With one QR factorization of U without its last
    block row, the least-squares solution at order n needs only leading n x n blocks: A_n = R_n⁻¹ (Qᵀ U₂)_n,
    because the leading n columns of Q and of R are the factors of the leading n columns of U.

    Args:
        U: orthonormal columns, most important first, shape (n_rows * n_outputs, n_max).
        singular_values: of the columns of `U`, shape (n_max,) or longer; they scale the states only.
        n_outputs: rows of a block.
        orders: orders asked for, each at most n_max.

    Returns:
        A, shape (n, n), and C, shape (n_outputs, n), for each n in `orders`.

    Raises:
        OrderError: an order exceeds the columns of `U`, or the rows left when one block row is dropped.

    Source: Kung (1978), 12th Asilomar Conf., the shift invariance O₁ A = O₂ of the observability matrix without
        its last and without its first block row; nested over the orders as in Döhler and Mevel (2012), Mech.
        Syst. Signal Process. 31.
    """
    orders = list(orders)
    n_max = max(orders, default=0)
    n_columns = min(U.shape[1], U.shape[0] - n_outputs)
    if n_max > n_columns:
        raise OrderError(
            f"order {n_max} exceeds the {n_columns} independent columns of the {U.shape[0]} x {U.shape[1]} "
            "subspace without its last block row; lower the order or take more block rows"
        )
    Q, R = scipy.linalg.qr(U[:-n_outputs, :n_max], mode="economic")
    X = Q.T @ U[n_outputs:, :n_max]  # (n_max, n_max)
    if n_max and np.min(np.abs(np.diag(R))) == 0:
        raise OrderError(f"order {n_max} has a state that only the last block row sees; take more block rows")
    # The floor keeps the scaling invertible where a singular value is zero; any scaling gives the same model.
    floor = np.finfo(float).eps * np.max(singular_values[:1], initial=0.0) or 1.0
    root = np.sqrt(np.maximum(singular_values[:n_max], floor))
    left, right = scipy.linalg.solve_triangular(R, np.eye(n_max)) / root[:, None], X * root
    C = U[:n_outputs, :n_max] * root
    return [(left[:n, :n] @ right[:n, :n], C[:, :n]) for n in orders]


def numerical_rank(singular_values: Array, shape: tuple[int, int]) -> int:
    """How many singular values of a matrix of that shape, largest first, stand above rounding.

    Args:
        singular_values: largest first.
        shape: of the matrix.

    Returns:
        At most their number.
    """
    return int(
        np.sum(singular_values > np.finfo(float).eps * max(shape) * np.max(singular_values, initial=0.0))
    )


def choose_order(P: Array, S: Array, Q: Array, *, n_outputs: int, n_inputs: int) -> tuple[int, str]:
    """The number of states that the singular values of a Hankel matrix show, and the reason in one sentence.

    Calculated data fall off a cliff: the last fall by a factor of 1000 or more to below 1e-8 of the
    largest value ends the signal. Measured data end in a floor of noise. If what lies beyond an order
    were noise, with a variance of its own in each output and each input, its singular values would
    not reach much above the root of the largest mean square of a row plus that of a column. The order
    is the last one whose own value exceeds 1.5 times that edge (the repetition of entries in a Hankel
    matrix takes up to 1.2), made even as an oscillation takes two states.

    Args:
        P: left singular vectors in columns, shape (n_rows * n_outputs, n_values).
        S: all singular values, largest first, shape (n_values,).
        Q: right singular vectors in columns, shape (n_columns * n_inputs, n_values).
        n_outputs: rows of a block.
        n_inputs: columns of a block.

    Returns:
        The order and the reason.

    Raises:
        OrderError: the matrix is zero.

    Source: Bandeira and van Handel (2016), Ann. Probab. 44(4), the norm of a matrix of unequal independent noise:
        about max_i (Σ_j σ_ij²)^½ + max_j (Σ_i σ_ij²)^½.
    """
    rows, columns = P.shape[0], Q.shape[0]
    s = np.maximum(S, np.finfo(float).eps * max(rows, columns) * S[0])
    if s[0] == 0:
        raise OrderError("all singular values are zero: the data hold no response; check the channels")
    cliffs = np.flatnonzero((s[:-1] >= 1e3 * s[1:]) & (s[1:] <= 1e-8 * s[0]))
    if cliffs.size:
        order = int(cliffs[-1]) + 1
        return order, (
            f"Order {order} is where the singular values fall from {s[order - 1] / s[0]:.1e} to "
            f"{s[order] / s[0]:.1e} of the largest."
        )
    n = np.arange(s.size // 2 + 1)
    share = rows * columns / ((rows - n) * (columns - n))  # the singular vectors kept took noise with them
    row = share * _largest_mean_square(P, s, n_outputs)[n]
    column = share * _largest_mean_square(Q, s, n_inputs)[n]
    edge = 1.5 * (np.sqrt(row) + np.sqrt(column))
    above = np.flatnonzero(s[n[1:] - 1] > edge[1:])
    if not above.size:
        return 2, "Order 2: no singular value stands above the noise, so the data hardly show an oscillation."
    last = int(above[-1]) + 1
    if last == n[-1]:
        return last, f"Order {last}: no edge of noise is in sight, so the Hankel matrix may be too small."
    order = min(last + last % 2, s.size)
    return order, (
        f"Order {order}: singular value {last} is the last above the edge of the noise, "
        f"{edge[last] / s[0]:.1e} of the largest."
    )


def _largest_mean_square(vectors: Array, s: Array, n_channels: int) -> Array:
    """Mean square of a row of the noisiest channel in what is left beyond each order, shape (n_values,)."""
    power = np.mean(np.square(vectors).reshape(-1, n_channels, s.size), axis=0) * s**2
    return np.asarray(np.max(np.cumsum(power[:, ::-1], axis=1)[:, ::-1], axis=0))
