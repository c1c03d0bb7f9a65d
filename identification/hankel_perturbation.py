"""How far a model realized from Markov parameters moves when they move a little.

With H(0) = O Γ of rank n, and in the coordinates that keep O⁺ dO = 0, a change dH moves the model by
dA = O⁺ (dH(1) - A-shifted part), linear in dH, without a decomposition per change.
"""

from __future__ import annotations

import numpy as np
import scipy.fft

from identification.errors import IdentificationError
from identification.parameterizations import Tangent
from identification.recording import Array
from identification.systems import StateSpace

BATCH = 1 << 22
"""Numbers held at a time while changes are filtered."""


def observability(A: Array, C: Array, n_rows: int) -> Array:
    """O = [C; CA; CA²; …], shape (n_rows * n_outputs, n_states).

    Args:
        A: shape (n_states, n_states).
        C: shape (n_outputs, n_states).
        n_rows: block rows.

    Returns:
        C A^k, one below the other.

    Raises:
        IdentificationError: it grows beyond all bounds.

    Source: Juang and Pappa (1985), J. Guidance 8(5), the left factor of H(0) = O Γ.
    """
    blocks = np.empty((n_rows, *C.shape))
    block = C
    for i in range(n_rows):
        blocks[i] = block
        block = block @ A
        if not np.max(np.abs(block)) < 1e6 * (np.max(np.abs(C)) or 1.0):
            raise IdentificationError(
                f"a pole of the model grows beyond all bounds within {n_rows} samples; lower the order"
            )
    return blocks.reshape(-1, A.shape[0])


def hankel_tangent(system: StateSpace, changes: Array, *, n_rows: int, n_columns: int) -> Tangent:
    """Derivatives of the model along changes of the Markov parameters it was realized from.

    To first order in the noise this holds for every realization that keeps the leading singular vectors of
    H(0), whatever its normal form: similar models have the same modes and the same M, C, K.

    Args:
        system: sampled model.
        changes: dY, shape (n_changes, n_lags, n_outputs, n_inputs).
        n_rows: block rows of H(0).
        n_columns: block columns of H(0).

    Returns:
        The model with one derivative for each change.

    Raises:
        IdentificationError: the model grows beyond all bounds.

    Source: Longman, Bergmann and Juang (1988), Proc. AIAA/AAS Astrodynamics Conf., 88-4247, the variance of
        poles from ERA; for poles it is ψᴴ O⁺ (dH(1) - z dH(0)) Γ⁺ φ with ψᴴ φ = 1.
    """
    n_outputs, n_inputs = system.D.shape
    n = system.n_states
    O_inv = np.linalg.pinv(observability(system.A, system.C, n_rows))  # (n, n_rows * n_outputs)
    G = observability(system.A.T, system.B.T, n_columns).T  # Γ = [B, AB, A²B, …]
    right = np.asarray(np.linalg.pinv(G).reshape(n_columns, n_inputs, n))
    dA, dB, dC = (np.empty((len(changes), *X.shape)) for X in (system.A, system.B, system.C))
    step = max(1, BATCH // (changes.shape[1] * n_outputs * max(n, n_inputs)))
    for first in range(0, len(changes), step):
        part = slice(first, first + step)
        dY = changes[part, 1:]
        X = _hankel_product(dY, right, n_rows + 1)  # dH(0) Γ⁺ with one more block row
        X0, X1 = (X[:, shift : n_rows + shift].reshape(len(dY), -1, n) for shift in (0, 1))
        core = O_inv @ X0
        dA[part] = O_inv @ X1 - system.A @ core
        dB[part] = O_inv @ dY[:, :n_rows].reshape(len(dY), -1, n_inputs)
        dC[part] = X0[:, :n_outputs] - system.C @ core
    return Tangent(system, dA, dB, dC, changes[:, 0])


def _hankel_product(values: Array, right: Array, n_rows: int) -> Array:
    """Σ_j values[i + j] right[j] for block rows i, shape (n_changes, n_rows, n_outputs, n_columns of right)."""
    length = scipy.fft.next_fast_len(values.shape[1] + right.shape[0], real=True)
    V = scipy.fft.rfft(values, length, axis=1)
    W = scipy.fft.rfft(right, length, axis=0).conj()
    return np.asarray(scipy.fft.irfft(V @ W, length, axis=1)[:, :n_rows])
