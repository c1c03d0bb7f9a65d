"""Modal sum: the transfer function of a state space at many frequencies at once."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array

Complex = NDArray[np.complex128]

WORST_BASIS = 1e7
"""Condition of the eigenvectors beyond which they are no basis to compute in."""


def modal_sum(z: Complex, F: Array, G: Array, C: Array) -> Complex:
    """C (z I - F)⁻¹ G at every z, (n_z, n_outputs, n_inputs), by modes where they are a good basis."""
    return ModalBasis(F, z).transfer(G, C)


class ModalBasis:
    """(z I - F)⁻¹ at every z, by the modes of F where they are a good basis, else by solving line by line."""

    def __init__(self, F: Array, z: Complex) -> None:
        self._F, self._z = F, z
        self._values, self._V = np.linalg.eig(F)
        self._good = bool(np.linalg.cond(self._V) < WORST_BASIS)

    def transfer(self, G: Array, C: Array) -> Complex:
        """C (z I - F)⁻¹ G, (n_z, n_outputs, n_inputs)."""
        z, F = self._z, self._F
        if self._good:
            residues = (C @ self._V).T[:, :, None] * np.linalg.solve(self._V, G.astype(complex))[:, None, :]
            return np.asarray(
                (self._poles @ residues.reshape(F.shape[0], -1)).reshape(z.size, C.shape[0], G.shape[1])
            )
        shifted = z[:, None, None] * np.eye(F.shape[0]) - F
        return np.asarray(
            C @ np.linalg.solve(shifted, np.broadcast_to(G, (z.size, *G.shape)).astype(complex))
        )

    @cached_property
    def _poles(self) -> Complex:
        return np.asarray(1 / (self._z[:, None] - self._values))
