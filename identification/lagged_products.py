"""Products of signals with their own past, by which a predictor is fitted to long records at a fraction of the cost.

A regression on p past samples of all channels has p times as many columns as there are channels, but each block of columns
is the block before, one sample later. So their products follow from those with the newest samples alone: p times fewer
multiplications than any factorization of the rows takes. Squares lose half of the digits, and whoever uses them must see
to it that half are enough.
"""

from __future__ import annotations

import numpy as np

from identification.recording import Array, Recording
from identification.regression import BLOCK, FROM_REST


def lagged_products(recording: Recording, scale: Array, p: int) -> Array:
    """Σ w(k) w(k)ᵀ with w(k) = [v(k), v(k - 1), …, v(k - p)] and v = (u, y), over all k whose past is known.

    Args:
        recording: records with inputs; those of the kinds `FROM_REST` have a past of zeros.
        scale: each channel is divided by it, shape (n_inputs + n_outputs,).
        p: samples of past.

    Returns:
        Symmetric, shape ((p + 1) n_channels, (p + 1) n_channels).

    Source: Morf, Dickinson, Kailath and Vieira (1977), IEEE Trans. Acoust. Speech Signal Process. 25(5), 429-433: with
        Γ_ij = Σ v(k - i) v(k - j)ᵀ over p <= k < N, Γ_(i+1)(j+1) = Γ_ij + v(p-1-i) v(p-1-j)ᵀ - v(N-1-i) v(N-1-j)ᵀ.
    """
    width = scale.size
    total = np.zeros(((p + 1) * width, (p + 1) * width))
    for number in range(len(recording.records)):
        newest, first, last = _newest(recording, number, scale, p)
        row = newest  # Γ_i0 … Γ_ip, (width, (p + 1) * width)
        total[:width] += row
        for i in range(p):
            own = slice(i * width, (i + 1) * width)
            row = np.hstack(
                [
                    newest[:, (i + 1) * width : (i + 2) * width].T,
                    row[:, :-width] + np.outer(first[own], first) - np.outer(last[own], last),
                ]
            )
            total[(i + 1) * width : (i + 2) * width] += row
    return total


def _newest(recording: Recording, number: int, scale: Array, p: int) -> tuple[Array, Array, Array]:
    """Γ_00 … Γ_0p of one record, and the first and the last p samples, newest first, shape (p * n_channels,)."""
    record, width = recording.records[number], scale.size
    past = np.zeros((width, p if record.kind in FROM_REST else 0))
    first = past if past.shape[1] == p else None
    products = np.zeros((width, p + 1, width))
    for u, y in record.blocks(BLOCK):
        v = np.hstack([past, np.vstack([u, y]) / scale[:, None]])
        if first is None and v.shape[1] >= p:
            first = v[:, :p]
        for j in range(p + 1 if v.shape[1] > p else 0):
            products[:, j] += v[:, p:] @ v[:, p - j : v.shape[1] - j].T
        past = v[:, max(v.shape[1] - p, 0) :]
    if first is None:  # a record shorter than the past that is asked for has no row
        return np.zeros((width, (p + 1) * width)), np.zeros(p * width), np.zeros(p * width)
    return products.reshape(width, -1), first[:, ::-1].T.ravel(), past[:, ::-1].T.ravel()
