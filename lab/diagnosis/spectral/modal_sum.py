"""Modal sum: the transfer function of a state space at many frequencies at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array

Complex = NDArray[np.complex128]

WORST_BASIS = 1e7
"""Condition of the eigenvectors beyond which they are no basis to compute in."""


def modal_sum(z: Complex, F: Array, G: Array, C: Array) -> Complex:
    """C (z I - F)⁻¹ G at every z, (n_z, n_outputs, n_inputs), by modes where they are a good basis."""
    values, V = np.linalg.eig(F)
    if np.linalg.cond(V) < WORST_BASIS:
        residues = (C @ V).T[:, :, None] * np.linalg.solve(V, G.astype(complex))[:, None, :]
        flat = (1 / (z[:, None] - values)) @ residues.reshape(values.size, -1)
        return np.asarray(flat.reshape(z.size, C.shape[0], G.shape[1]))
    shifted = z[:, None, None] * np.eye(F.shape[0]) - F
    return np.asarray(C @ np.linalg.solve(shifted, np.broadcast_to(G, (z.size, *G.shape)).astype(complex)))
