"""Arrangement: the order and signs of channels under which measured mode shapes become the model's.

The rows of two matrices of mode shapes, measured Φ and modelled Ψ, shape (n_outputs, n_modes), belong together up to an
order and signs of the channels, and a sign of each mode. For every choice of the modes' signs the best order is an
assignment problem.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from identification.recording import Array


@dataclass(frozen=True)
class Arrangement:
    """Which measured channel belongs where.

    Attributes:
        order: measured row at each of the model's rows.
        signs: of those rows.
        agreement: mean MAC over the modes after reordering.
    """

    order: NDArray[np.int64]
    signs: Array
    agreement: float

    def arranged(self, shapes: Array) -> Array:
        """Measured shapes in the model's order and signs."""
        return np.asarray(shapes[self.order] * self.signs[:, None])

    @property
    def n_changes(self) -> int:
        """Channels out of place plus channels with another sign."""
        return int(np.sum(self.order != np.arange(self.order.size)) + np.sum(self.signs < 0))

    @property
    def as_named(self) -> bool:
        """Whether order and signs are those of the channels' names."""
        return bool(np.all(self.order == np.arange(self.order.size)) and np.all(self.signs == 1))


def macs(a: Array, b: Array) -> Array:
    """MAC of real shapes, column by column, shape (n_modes,)."""
    overlap = np.sum(a * b, axis=0) ** 2
    return np.asarray(overlap / (np.sum(a**2, axis=0) * np.sum(b**2, axis=0)))


def mean_mac(a: Array, b: Array) -> float:
    """Mean of `macs`."""
    return float(np.mean(macs(a, b)))


def best_arrangement(phi: Array, psi: Array) -> Arrangement:
    """The order and signs of measured rows under which the shapes agree best."""
    phi, psi = phi / np.linalg.norm(phi, axis=0), psi / np.linalg.norm(psi, axis=0)
    highest, order, signs = -1.0, np.arange(len(phi)), np.ones(len(phi))
    for flips in itertools.product((1.0, -1.0), repeat=phi.shape[1] - 1):
        overlap = (psi * np.array([1.0, *flips])) @ phi.T  # (rows of the model, measured rows)
        rows, columns = scipy.optimize.linear_sum_assignment(np.abs(overlap), maximize=True)
        taken = overlap[rows, columns]
        value = float(np.sum(np.abs(taken)))
        if value > highest + 1e-12:
            highest, order, signs = value, columns, np.where(taken < 0, -1.0, 1.0)
    if np.sum(signs < 0) > np.sum(signs > 0) or (np.sum(signs) == 0 and signs[0] < 0):
        # All signs at once are the signs of the modes, which mean nothing.
        signs = -signs
    return Arrangement(order, signs, mean_mac(phi[order] * signs[:, None], psi))


def next_best(best: Arrangement, phi: Array, psi: Array) -> float:
    """The best agreement after one sign is changed or two channels are exchanged."""
    here = best.arranged(phi)
    return max(mean_mac(here, other) for other in _neighbours(psi))


def _neighbours(psi: Array) -> list[Array]:
    """The shapes with one sign changed or two rows exchanged."""
    n = len(psi)
    found = []
    for i in range(n if n > 2 else 1):
        flipped = psi.copy()
        flipped[i] *= -1
        found.append(flipped)
    for i, j in itertools.combinations(range(n), 2):
        swapped = psi.copy()
        swapped[[i, j]] = swapped[[j, i]]
        found.append(swapped)
    return found


def balanced(shapes: Array) -> Array:
    """Shapes scaled row by row and column by column to equal mean squares, which takes all factors out.

    Source: Sinkhorn (1964), Ann. Math. Stat. 35, 876-879.
    """
    x = shapes.copy()
    for _ in range(100):
        x /= np.maximum(np.sqrt(np.mean(x**2, axis=1, keepdims=True)), 1e-300)
        x /= np.maximum(np.sqrt(np.mean(x**2, axis=0, keepdims=True)), 1e-300)
    return x
