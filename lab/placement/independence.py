"""Effective independence and kinetic energy: the classical rules for where sensors see the modes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.recording import Array
from lab.errors import LabError

TIE = 1e-9
"""Shares that differ by less, relative to the largest, are the same: the later block goes first."""


def effective_independence(blocks: Array, n: int, *, fixed: Sequence[int] = ()) -> tuple[int, ...]:
    """Blocks left when those that add least to the independence of the modes are deleted one by one.

    Args:
        blocks: mode shapes at the channels of each block, shape (n_blocks, n_channels, n_modes); rows of zeros where a
            block has fewer channels.
        n: blocks to keep, the fixed ones included.
        fixed: blocks that stay.

    Returns:
        The n blocks in rising order.

    Raises:
        LabError: the modes are not independent at all blocks together, or n blocks have too few channels.

    Source: Kammer (1991), J. Guid. Control Dyn. 14(2), 251-259, eq. (13) and (14); Kammer and Tinker (2004), Mech. Syst.
    Signal Process. 18(1), 29-41, for blocks: the share 1 - det(I - Φ_b (Φᵀ Φ)⁻¹ Φ_bᵀ) of the determinant that is lost.
    """
    left = np.arange(len(blocks))
    m = blocks.shape[2]
    if np.linalg.matrix_rank(blocks.reshape(-1, m)) < m or n * blocks.shape[1] < m:
        raise LabError(
            f"{n} sensors of {len(blocks)} candidates cannot tell {m} modes apart; ask for fewer modes or more sensors"
        )
    eye = np.eye(blocks.shape[1])
    while left.size > n:
        Phi = blocks[left]
        # Rows of an orthonormal basis: Φ_b (Φᵀ Φ)⁻¹ Φ_bᵀ = X_b X_bᵀ.
        X = np.linalg.qr(Phi.reshape(-1, m))[0].reshape(Phi.shape)
        share = 1 - np.linalg.det(eye - X @ X.transpose(0, 2, 1))
        share[np.isin(left, fixed)] = np.inf
        weakest = np.flatnonzero(share <= np.min(share) + TIE)
        left = np.delete(left, weakest[-1])
    return tuple(int(block) for block in left)


def kinetic_energy(blocks: Array, momenta: Array, n: int, *, fixed: Sequence[int] = ()) -> tuple[int, ...]:
    """Blocks with the largest kinetic energy, summed over the modes.

    Args:
        blocks: mode shapes Φ at the channels of each block, shape (n_blocks, n_channels, n_modes).
        momenta: M Φ at the same places, the same shape.
        n: blocks to choose, the fixed ones included.
        fixed: blocks chosen already.

    Returns:
        The n blocks in rising order.

    Source: Salama, Rose and Garba (1987), Proc. 28th SDM Conference, AIAA 87-0782.
    """
    energy = np.sum(blocks * momenta, axis=(1, 2))
    energy[list(fixed)] = np.inf
    return tuple(sorted(int(block) for block in np.argsort(-energy, kind="stable")[:n]))
