"""Least squares over records longer than memory: triangular factors that grow block by block."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from identification.recording import Array, Recording

FROM_REST = ("pulse", "impact")
"""Kinds of record that begin before the structure moves."""

BLOCK = 4096
"""Rows that are brought to triangular form at a time."""

LONG = 10_000
"""Rows of a regression beyond which the products of its columns stand for them, where those have digits enough."""


def rms(recording: Recording) -> Array:
    """Root mean square of each input, then each output, over all records.

    Args:
        recording: inputs and outputs.

    Returns:
        Shape (n_inputs + n_outputs,).
    """
    total = np.zeros(len(recording.inputs) + len(recording.outputs))
    for record in recording.records:
        for u, y in record.blocks(1 << 16):
            total += np.concatenate([np.sum(u**2, axis=1), np.sum(y**2, axis=1)])
    return np.asarray(np.sqrt(total / recording.n_samples))


def triangular(R: Array, rows: Array) -> Array:
    """Triangular factor of the rows stacked below R: exact, and no larger than the columns.

    Args:
        R: upper triangular, shape (n, n_columns) with n at most n_columns.
        rows: shape (n_rows, n_columns).

    Returns:
        Upper triangular, with the same inner products of columns as both together.
    """
    stacked = np.vstack([R, rows])
    return np.asarray(
        scipy.linalg.qr(stacked, mode="r", overwrite_a=True, check_finite=False)[0][: stacked.shape[1]]
    )


def factor_of_products(products: Array, n_rows: int) -> Array | None:
    """Triangular factor of the rows of a regression from the products of its columns, or None for want of digits.

    With columns scaled to equal size, rounding moves the coefficients by ε κ at most, where κ is the condition of the
    products, and by a hundredth of that as found; noise moves the worst known combination by about 1 / √n_rows. So the
    products will do where ε κ is no more than the noise.

    Args:
        products: of all columns, those that are fitted among them, shape (n_columns, n_columns).
        n_rows: how many rows they are sums over.

    Returns:
        Upper triangular R with RᵀR = products.

    Source: Björck (1996), Numerical Methods for Least Squares Problems, section 2.2: normal equations err by ε κ(AᵀA).
    """
    size = np.sqrt(np.diag(products))
    if not np.all(size > 0):
        return None
    scaled = products / size / size[:, None]
    try:
        R = np.asarray(scipy.linalg.cholesky(scaled))
    except np.linalg.LinAlgError:
        return None
    reciprocal = scipy.linalg.lapack.dpocon(R, np.max(np.sum(np.abs(scaled), axis=0)))[0]
    return R * size if np.finfo(float).eps * np.sqrt(n_rows) < reciprocal else None


def least_squares(R: Array, right: Array, cutoff: float) -> tuple[Array, int]:
    """Smallest X that minimizes |R X - right|, and the rank.

    Args:
        R: shape (n_rows, n_columns).
        right: shape (n_rows, n_right).
        cutoff: singular values below this part of the largest count as zero, columns scaled to equal size.

    Returns:
        X, shape (n_columns, n_right), and the rank.
    """
    size = np.linalg.norm(R, axis=0)
    size[size == 0] = 1
    n = R.shape[1]
    # A triangle that is far from singular needs no singular values to say so.
    if R.shape == (n, n) and n and not np.any(np.tril(R, -1)):
        reciprocal = scipy.linalg.lapack.dtrcon(R / size)[0]
        if reciprocal > 10 * n * cutoff:
            return np.asarray(scipy.linalg.solve_triangular(R, right)), n
    U, s, Vt = scipy.linalg.svd(R / size)
    rank = int(np.sum(s > cutoff * s[0]))
    X = Vt[:rank].T @ ((U[:, :rank].T @ right) / s[:rank, None])
    return X / size[:, None], rank
