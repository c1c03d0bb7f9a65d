"""Responses of a state space and of its derivatives when modes do not exist: rigid bodies, critical damping.

A = Z T Zᴴ with T triangular: the last state runs by itself, drives the one above, and so on. Nothing is
divided by differences of poles, so nothing is lost where they coincide; `modal_responses` does the same work
many times faster where they do not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.modal_signals import Run, recursion
from identification.parameterizations import Tangent
from identification.recording import Array
from identification.systems import StateSpace

Complex = NDArray[np.complex128]
BLOCK = 1 << 10


def simulate(system: StateSpace, run: Run, initial: Array | None) -> Array:
    """Outputs under the inputs of the run and from the initial state, shape (n_outputs, n_samples).

    Args:
        system: sampled, or continuous and held over each sample.
        run: the record; its outputs do not matter.
        initial: state at the first sample; rest when None.

    Returns:
        Shape (n_outputs, n_samples).
    """
    system = system if system.dt else system.sampled(run.dt)
    T, Z = scipy.linalg.schur(system.A, output="complex")
    start = np.zeros(system.n_states) if initial is None else initial
    w, _ = _states(T, Z.conj().T @ system.B[:, run.active] @ run.inputs, Z.conj().T @ start)
    return np.asarray(np.real(system.C @ Z @ w) + system.D[:, run.active] @ run.inputs)


def normal_equations(
    tangent: Tangent, run: Run, initial: Array | None, weights: Array
) -> tuple[Array, Array]:
    """Jᵀ W e and Jᵀ W J, as `modal_responses.normal_equations` gives them.

    Args:
        tangent, run, initial, weights: as for `modal_responses.normal_equations`.

    Returns:
        Shapes (n,) and (n, n).

    Source: as for `modal_responses.normal_equations`.
    """
    tangent = tangent if tangent.system.dt else _sampled(tangent, run.dt)
    system = tangent.system
    n, extra = system.n_states, 0 if initial is None else system.n_states
    T, Z = scipy.linalg.schur(system.A, output="complex")
    Zh = Z.conj().T
    B, dA, dB = Zh @ system.B[:, run.active], Zh @ tangent.A_theta @ Z, Zh @ tangent.B_theta[:, :, run.active]
    C, dC = system.C @ Z, tangent.C_theta @ Z
    w_next = Zh @ (np.zeros(n) if initial is None else initial)
    dw_next = np.concatenate([np.zeros((len(dA), n)), Zh.T[:extra]])
    gradient = np.zeros(len(dw_next))
    information = np.zeros((len(dw_next), len(dw_next)))
    for first in range(0, run.outputs.shape[1], BLOCK):
        where = slice(first, first + BLOCK)
        u = run.inputs[:, where]
        w, w_next = _states(T, B @ u, w_next)
        forcing = np.zeros((len(dw_next), n, u.shape[1]), dtype=complex)
        forcing[: len(dA)] = dA @ w + dB @ u
        dw, dw_next = _states(T, forcing, dw_next)
        J = np.real(C @ dw)  # (n_parameters, n_outputs, n_samples)
        J[: len(dA)] += np.real(dC @ w) + tangent.D_theta[:, :, run.active] @ u
        if run.missing is not None:
            J[:, run.missing[:, where]] = 0
        e = run.errors(np.real(C @ w) + system.D[:, run.active] @ u, where)
        WJ = weights[:, None] * J
        gradient += np.tensordot(WJ, e, 2)
        information += np.tensordot(WJ, J, ((1, 2), (1, 2)))
    return gradient, information


def _states(T: Complex, forcing: Complex, start: Complex) -> tuple[Complex, Complex]:
    """w⁺ = T w + forcing from `start`, (…, n_states, n_samples), and the state after the last sample."""
    w, after = np.empty_like(forcing, dtype=complex), np.empty_like(start, dtype=complex)
    for i in reversed(range(len(T))):
        drive = forcing[..., i, :] + np.tensordot(w[..., i + 1 :, :], T[i, i + 1 :], ((-2,), (0,)))
        w[..., i, :], after[..., i] = recursion(T[i, i], drive, start[..., i])
    return w, after


def _sampled(tangent: Tangent, dt: float) -> Tangent:
    """The model behind a zero-order hold, with exact derivatives.

    Source: Van Loan (1978), IEEE Trans. Autom. Control 23(3): exp [F ∂F; 0 F] holds ∂exp F.
    """
    system = tangent.system
    n, m = system.B.shape
    F = np.block([[system.A, system.B], [np.zeros((m, n + m))]])
    dF = np.zeros((tangent.n_parameters, n + m, n + m))
    dF[:, :n, :n], dF[:, :n, n:] = tangent.A_theta, tangent.B_theta
    both = np.zeros((len(dF), 2 * (n + m), 2 * (n + m)))
    both[:, : n + m, : n + m] = both[:, n + m :, n + m :] = F
    both[:, : n + m, n + m :] = dF
    moved = scipy.linalg.expm(both * dt)[:, :n, n + m :]
    held = scipy.linalg.expm(F * dt)
    sampled = replace(system, A=held[:n, :n], B=held[:n, n:], dt=dt)
    return Tangent(sampled, moved[:, :, :n], moved[:, :, n:], tangent.C_theta, tangent.D_theta)
