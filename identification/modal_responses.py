"""Responses of a state space and of all its derivatives at once, mode by mode and exact for held inputs.

With A = Φ Λ Φ⁻¹ the outputs are sums of modal responses r, each the answer of one pole to one input. To first
order a change of parameters mixes the r, where it turns eigenvectors, and adds the divided differences
d = (r_a - r_b) / (λ_a - λ_b) of poles that are close, ∂r/∂λ of each with itself among them. So few signals span
the derivatives with respect to any number of parameters, and the normal equations need no more of the data than
the products of these signals.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from identification.modal_signals import Complex, Pairs, Run, Spectrum, close_pairs, signals
from identification.parameterizations import Tangent
from identification.recording import Array
from identification.systems import StateSpace


def simulate(system: StateSpace, modes: Spectrum, run: Run, initial: Array | None) -> Array:
    """Outputs under the inputs of the run and from the initial state, shape (n_outputs, n_samples).

    Args:
        system: the model.
        modes: its spectrum.
        run: the record; its outputs do not matter.
        initial: state at the first sample; rest when None.

    Returns:
        Shape (n_outputs, n_samples).
    """
    weights = output_weights(system, modes, run, initial)
    blocks = [weights @ X for _, X in signals(system, modes, run, initial is not None, None)]
    return np.concatenate(blocks, axis=1)


def normal_equations(
    tangent: Tangent, modes: Spectrum, run: Run, initial: Array | None, weights: Array
) -> tuple[Array, Array]:
    """Jᵀ W e and Jᵀ W J, where e = outputs - prediction and J = ∂ prediction / ∂(θ, initial state).

    Args:
        tangent: the model and its derivatives.
        modes: the spectrum of the model.
        run: the record.
        initial: state at the first sample, which then counts as further parameters; rest when None.
        weights: one over the noise variance of each output, shape (n_outputs,).

    Returns:
        Shapes (n,) and (n, n), where n counts the parameters and the states of `initial`.

    Source: Kay (1993), Fundamentals of Statistical Signal Processing I, eq. (3.31), for a covariance that does
        not depend on the parameters.
    """
    predict = output_weights(tangent.system, modes, run, initial)
    pairs = close_pairs(modes, tangent.system.dt, run)
    G: Array = np.zeros(())  # products of the signals among themselves, (n_signals, n_signals)
    V: Array = np.zeros(())  # and with the residuals, (n_signals, n_outputs)
    unseen: Array | None = None  # what G would be over the samples missing, (n_outputs, n_signals, n_signals)
    for where, X in signals(tangent.system, modes, run, initial is not None, pairs):
        G = G + X @ X.T
        V = V + X @ run.errors(predict @ X[: predict.shape[1]], where).T
        if run.missing is not None:
            unseen = _squares_at(X, run.missing[:, where], unseen)
    n = tangent.n_parameters + (0 if initial is None else tangent.system.n_states)
    gradient, information = np.zeros(n), np.zeros((n, n))
    for o, T in enumerate(derivative_weights(tangent, modes, run, initial, pairs)):
        # The shape at one output does not move the others.
        rows = np.flatnonzero(np.any(T, axis=1))
        gradient[rows] += weights[o] * (T[rows] @ V[:, o])
        seen = G if unseen is None else G - unseen[o]
        information[np.ix_(rows, rows)] += weights[o] * (T[rows] @ seen @ T[rows].T)
    return gradient, information


def _squares_at(X: Array, missing: NDArray[np.bool_], before: Array | None) -> Array:
    """Products of signals over the samples that each output misses, added to those of earlier blocks."""
    products = np.stack([X[:, gone] @ X[:, gone].T for gone in missing])
    return products if before is None else before + products


def output_weights(system: StateSpace, modes: Spectrum, run: Run, initial: Array | None) -> Array:
    """What each Re r, Im r and input counts in each output, shape (n_outputs, n_signals without d).

    Args:
        system: the model.
        modes: its spectrum.
        run: the record, for its active inputs.
        initial: state at the first sample; rest when None.

    Returns:
        Coefficients of the first of the `signals`.

    Source: γ (s - Λ)⁻¹ β in partial fractions, as in `derivative_weights`.
    """
    gamma, beta = _gamma(system, modes), _beta(system, modes, run, initial)[modes.own]
    c = gamma[:, :, None] * beta
    flat = [x.reshape(len(gamma), -1) for x in (c.real, -c.imag)]
    return np.concatenate([*flat, system.D[:, run.active]], axis=1)


def _gamma(system: StateSpace, modes: Spectrum) -> Complex:
    return (system.C @ modes.phi)[:, modes.own] * modes.twice


def _beta(system: StateSpace, modes: Spectrum, run: Run, initial: Array | None) -> Complex:
    sources = system.B[:, run.active]
    if initial is not None:
        sources = np.column_stack([sources, initial])
    return modes.phi_inv @ sources


def derivative_weights(
    tangent: Tangent, modes: Spectrum, run: Run, initial: Array | None, pairs: Pairs
) -> Iterator[Array]:
    """What each signal counts in the derivatives of each output, shape (n_parameters, n_signals).

    Args:
        tangent: the model and its derivatives.
        modes: the spectrum of the model.
        run: the record, for its active inputs.
        initial: state at the first sample, which then counts as further parameters; rest when None.
        pairs: of poles that are close.

    Yields:
        Coefficients of all `signals`, one output at a time.

    Source: first-order perturbation of eigenvalues and eigenvectors: γ (s - Λ)⁻¹ ∂A (s - Λ)⁻¹ β in partial
    fractions, but for close poles.
    """
    system, own = tangent.system, modes.own
    dA = modes.phi_inv @ tangent.A_theta @ modes.phi
    gap = modes.poles[:, None] - modes.poles
    turn = np.where(pairs.near, 0, 1 / np.where(pairs.near, 1, gap))
    gamma, beta = system.C @ modes.phi, _beta(system, modes, run, initial)
    sources = tangent.B_theta[:, :, run.active]
    if initial is not None:
        sources = np.concatenate([sources, np.zeros((*sources.shape[:2], 1))], axis=2)
    d_gamma = (tangent.C_theta @ modes.phi + gamma @ (dA * turn.T))[:, :, own]
    d_beta = (modes.phi_inv @ sources + (dA * turn) @ beta)[:, own]
    a, b = pairs.a, pairs.b
    half = np.where(a == b, 0.5, 1.0) * pairs.twice
    d_ab, d_ba = dA[:, a, b] * half, dA[:, b, a] * half
    twice = modes.twice[:, None]
    for o in range(len(gamma)):
        g = gamma[o, own, None] * twice
        r = d_gamma[:, o, :, None] * twice * beta[own] + g * d_beta  # (n_parameters, n_own, n_sources)
        d = (gamma[o, a] * d_ab)[:, :, None] * beta[b] + (gamma[o, b] * d_ba)[:, :, None] * beta[a]
        parts = (r.real, -r.imag, tangent.D_theta[:, o, run.active], d.real, -d.imag)
        T = np.concatenate([x.reshape(len(r), -1) for x in parts], axis=1)
        if initial is None:
            yield T
        else:
            yield np.concatenate([T, _of_initial(g * modes.phi_inv[own], r.shape[1:], T.shape[1])])


def _of_initial(answer: Complex, sources: tuple[int, ...], n_signals: int) -> Array:
    """Rows of the initial states: they drive the last source through the modes, answer (n_own, n_states)."""
    rows = np.zeros((answer.shape[1], *sources), dtype=complex)
    rows[:, :, -1] = answer.T
    size = sources[0] * sources[1]
    T = np.zeros((answer.shape[1], n_signals))
    T[:, :size], T[:, size : 2 * size] = (x.reshape(len(rows), -1) for x in (rows.real, -rows.imag))
    return T
