"""Nearby: how continuous responses change with one mass, stiffness or damping, to first order and exactly.

A change of one of them changes the dynamic stiffness Z = M s² + C_d s + K by U D Uᵀ with few columns in U, so that Z need
not be inverted again: (Z + U D Uᵀ)⁻¹ = Z⁻¹ - Z⁻¹ U (I + D Uᵀ Z⁻¹ U)⁻¹ D Uᵀ Z⁻¹.

Source: Woodbury (1950), Princeton Statistical Research Group, Memorandum 42; to first order Fox and Kapoor (1968), AIAA J. 6,
2426-2429, in responses instead of modes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from identification.recording import Array
from lab.diagnosis.spectral.continuous import Complex, Receptance, all_rows, behind_channels, pushes, read
from lab.plant import Plant
from lab.twin import Twin

SMALLEST = 1e-12
"""Share of the largest weight of a body's part of M below which a direction is rounding."""


class Share(NamedTuple):
    """What one mass, stiffness or damping brings to the dynamic stiffness: s^power · columns · diag(weights) · columnsᵀ.

    Attributes:
        power: of s.
        columns: (n_dofs, rank).
        weights: (rank,).
    """

    power: int
    columns: Array
    weights: Array


@lru_cache(maxsize=8)
def shares_of(twin: Twin) -> tuple[Share, ...]:
    """Of every mass, then every stiffness, then every damping of a twin."""
    found = []
    for part in twin.masses:
        weights, columns = np.linalg.eigh(part)
        kept = np.abs(weights) > SMALLEST * np.max(np.abs(weights))
        found.append(Share(2, columns[:, kept], weights[kept]))
    for power, coefficients in ((0, twin.stiffness), (1, twin.damping)):
        found += [
            Share(power, row[:, None], np.array([c])) for row, c in zip(twin.rows, coefficients, strict=True)
        ]
    return tuple(found)


class Nearby:
    """Responses of a plant and of those with one share of its dynamic stiffness changed."""

    def __init__(self, plant: Plant, s: Complex, shares: Sequence[Share]) -> None:
        """Everything that changes of single shares need.

        Args:
            plant: as it stands; it may have more degrees of freedom, behind those of the shares.
            s: complex frequencies [rad/s], (n_s,).
            shares: what may change.
        """
        self._s, self._shares = s, shares
        self._order = list(plant.order) or slice(None)
        self._receptance = Receptance(plant, s)
        self._columns = [_padded(share.columns, plant.n_dofs) for share in shares]
        every, B = np.hstack(self._columns), pushes(plant)
        rows = all_rows(plant)
        used = np.any(rows, axis=1)
        through = np.zeros((s.size, len(rows), every.shape[1] + B.shape[1]), dtype=complex)
        through[:, used] = self._receptance.between(rows[used], np.hstack([every, B]))
        self._read, self._bare = np.split(read(plant, s, through), [every.shape[1]], axis=2)
        self._driven = self._receptance.between(every.T, B)  # (n_s, all ranks, n_inputs)
        self._ends = np.cumsum([share.weights.size for share in shares])
        # Channels multiply, so that what they do to ones they do to all.
        self._channels = behind_channels(plant, np.ones(self._bare.shape, dtype=complex), s)

    def slope(self, j: int) -> Complex:
        """Derivative of the response by a factor on share j, which adds a part of its nominal size."""
        left, right, share = self._sides(j)
        D = share.weights * (self._s**share.power)[:, None]
        if D.shape[1] == 1:
            return self._behind(-left * (D[:, :, None] * right))
        return self._behind(-left @ (D[:, :, None] * right))

    def with_factors(self, j: int, factors: Array) -> Iterator[Complex]:
        """Responses with share j multiplied by each of some factors: factor - 1 of its nominal size is added."""
        left, right, share = self._sides(j)
        U = self._columns[j]
        G = self._receptance.between(U.T, U)  # (n_s, rank, rank)
        D = share.weights * (self._s**share.power)[:, None]  # (n_s, rank)
        DG, pushed, eye = D[:, :, None] * G, D[:, :, None] * right, np.eye(U.shape[1])
        for factor in factors:
            change = factor - 1
            if len(eye) == 1:
                moved = change * pushed / (1 + change * DG)
            else:
                moved = np.linalg.solve(eye + change * DG, change * pushed)
            yield self._behind(self._bare - left @ moved)

    def _behind(self, H: Complex) -> Complex:
        """Bare responses as the channels give them."""
        return np.asarray(self._channels * H[:, self._order])

    def _sides(self, j: int) -> tuple[Complex, Complex, Share]:
        share = self._shares[j]
        own = slice(self._ends[j] - share.weights.size, self._ends[j])
        return self._read[:, :, own], self._driven[:, own], share


def _padded(columns: Array, n: int) -> Array:
    return np.vstack([columns, np.zeros((n - len(columns), columns.shape[1]))])
