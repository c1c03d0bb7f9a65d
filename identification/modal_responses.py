"""Responses of a state space and of all its derivatives at once, mode by mode and exact for held inputs.

With A = Φ Λ Φ⁻¹ the outputs are sums of modal responses r, each the answer of one pole to one input. To first
order a change of parameters mixes the r, where it turns eigenvectors, and adds the divided differences
d = (r_a - r_b) / (λ_a - λ_b) of poles that are close, ∂r/∂λ of each with itself among them. So few signals span
the derivatives with respect to any number of parameters, and the normal equations need no more of the data than
the products of these signals.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.parameterizations import Tangent
from identification.recording import Array
from identification.systems import StateSpace
from identification.zero_order_hold import divided_hold, hold

Complex = NDArray[np.complex128]
BLOCK = 1 << 14
ILL_CONDITIONED = 1e4


class Run(NamedTuple):
    """One record as the likelihood sees it.

    Attributes:
        inputs: those that act at all, shape (n_active, n_samples).
        active: their positions among the input channels.
        outputs: shape (n_outputs, n_samples), zero where missing.
        dt: sample time [s].
        missing: which samples of the outputs are, shape (n_outputs, n_samples); None where none is.
    """

    inputs: Array
    active: NDArray[np.intp]
    outputs: Array
    dt: float
    missing: NDArray[np.bool_] | None = None

    def errors(self, predicted: Array, where: slice = slice(None)) -> Array:
        """Measured minus predicted outputs over a stretch, zero where nothing was measured."""
        e = self.outputs[:, where] - predicted
        if self.missing is not None:
            e[self.missing[:, where]] = 0
        return np.asarray(e)


class Spectrum(NamedTuple):
    """Poles and eigenvectors of A.

    Attributes:
        poles: all of them, as A has them: sampled or continuous, shape (n_states,).
        phi: eigenvectors Φ, shape (n_states, n_states).
        phi_inv: Φ⁻¹.
        own: positions of the poles that stand for themselves and their conjugates.
        partner: position of the conjugate of each pole, shape (n_states,).
        twice: 2 for the poles that do, 1 for real ones, shape (n_own,).
    """

    poles: Complex
    phi: Complex
    phi_inv: Complex
    own: NDArray[np.intp]
    partner: NDArray[np.intp]
    twice: Array


class Pairs(NamedTuple):
    """Poles so close that their responses cannot be told apart, each with itself included; one of conjugates.

    Attributes:
        near: whether two poles are close, shape (n_states, n_states).
        a: positions of the first ones, shape (n_pairs,).
        b: positions of the second ones.
        twice: 2 for pairs that stand for their conjugates too, 1 for others.
    """

    near: NDArray[np.bool_]
    a: NDArray[np.intp]
    b: NDArray[np.intp]
    twice: Array


def spectrum(system: StateSpace) -> Spectrum | None:
    """Poles and eigenvectors; None where A has too few eigenvectors to work with, as at a critical damping.

    Args:
        system: sampled or continuous.

    Returns:
        Poles and eigenvectors, or None.
    """
    # In balanced coordinates the units of the states have no say in the condition number.
    balanced, (scale, _) = scipy.linalg.matrix_balance(system.A, permute=False, separate=True)
    poles, phi = scipy.linalg.eig(balanced)
    if system.n_states and np.linalg.cond(phi) > ILL_CONDITIONED:
        return None
    phi = scale[:, None] * phi
    own = np.flatnonzero(poles.imag >= 0)
    # Of a real matrix, conjugates come side by side, the one with positive imaginary part first.
    partner = np.arange(poles.size)
    up = np.flatnonzero(poles.imag > 0)
    partner[up], partner[up + 1] = up + 1, up
    twice = np.where(poles[own].imag > 0, 2.0, 1.0)
    phi_inv = np.linalg.inv(phi).astype(complex)
    return Spectrum(poles.astype(complex), phi.astype(complex), phi_inv, own, partner, twice)


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
    weights = _prediction(system, modes, run, initial)
    blocks = [weights @ X for _, X in _signals(system, modes, run, initial is not None, None)]
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
    predict = _prediction(tangent.system, modes, run, initial)
    pairs = close_pairs(modes, tangent.system.dt, run)
    G: Array = np.zeros(())  # products of the signals among themselves, (n_signals, n_signals)
    V: Array = np.zeros(())  # and with the residuals, (n_signals, n_outputs)
    unseen: Array | None = None  # what G would be over the samples missing, (n_outputs, n_signals, n_signals)
    for where, X in _signals(tangent.system, modes, run, initial is not None, pairs):
        G = G + X @ X.T
        V = V + X @ run.errors(predict @ X[: predict.shape[1]], where).T
        if run.missing is not None:
            unseen = _squares_at(X, run.missing[:, where], unseen)
    n = tangent.n_parameters + (0 if initial is None else tangent.system.n_states)
    gradient, information = np.zeros(n), np.zeros((n, n))
    for o, T in enumerate(_coefficients(tangent, modes, run, initial, pairs)):
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


def close_pairs(modes: Spectrum, system_dt: float, run: Run) -> Pairs:
    """Pairs of poles that drift apart by less than a hundredth while their responses last.

    Others may be divided by their difference: squared, as in the information, that costs four digits.

    Args:
        modes: poles of the model.
        system_dt: its sample time [s]; 0 for a continuous one.
        run: the record, for its length.

    Returns:
        The pairs.
    """
    poles = modes.poles
    size = np.maximum(np.abs(poles), np.finfo(float).tiny)
    rate = np.minimum(np.abs(np.log(size)), 1) if system_dt else np.abs(poles.real)
    lasting = run.outputs.shape[1] * (1.0 if system_dt else run.dt)
    near = np.abs(poles[:, None] - poles) < 1e-2 * (rate + 1 / lasting)
    near |= near.T
    a, b, twice = [], [], []
    for i, j in zip(*np.nonzero(np.triu(near)), strict=True):
        conjugate = sorted((modes.partner[i], modes.partner[j]))
        if [i, j] <= conjugate:
            a.append(i)
            b.append(j)
            twice.append(1.0 if [i, j] == conjugate else 2.0)
    return Pairs(near, np.array(a, dtype=np.intp), np.array(b, dtype=np.intp), np.array(twice))


def _signals(
    system: StateSpace, modes: Spectrum, run: Run, released: bool, pairs: Pairs | None
) -> Iterator[tuple[slice, Array]]:
    """Blocks of Re r and Im r of each own pole and source, the inputs themselves, then Re d and Im d of each pair.

    Sources are the active inputs and, when `released`, the initial state.
    """
    n_inputs, n_samples = run.inputs.shape
    z, h = hold(modes.poles, system.dt, run.dt)
    r_next = np.zeros((len(z), n_inputs + released), dtype=complex)
    r_next[:, n_inputs:] = 1
    first, second = (pairs.a, pairs.b) if pairs else (np.zeros(0, dtype=np.intp),) * 2
    dz, dh = divided_hold(modes.poles[first], modes.poles[second], system.dt, run.dt)
    d_next = np.zeros((len(first), n_inputs + released), dtype=complex)
    for start in range(0, n_samples, BLOCK):
        where = slice(start, min(start + BLOCK, n_samples))
        u = run.inputs[:, where]
        forcing = np.concatenate([u, np.zeros((int(released), u.shape[1]))])
        r = np.empty((len(z), *forcing.shape), dtype=complex)
        for i in modes.own:
            r[i], r_next[i] = recursion(z[i], h[i] * forcing, r_next[i])
        r[modes.partner[modes.own]] = r[modes.own].conj()
        d = np.empty((len(first), *forcing.shape), dtype=complex)
        for k, (a, b) in enumerate(zip(first, second, strict=True)):
            # r_a - r_b obeys the recursion of r_a, driven by what sets the two apart.
            d[k], d_next[k] = recursion(z[a], dz[k] * r[b] + dh[k] * forcing, d_next[k])
        own = r[modes.own]
        yield where, np.concatenate([_rows(own.real), _rows(own.imag), u, _rows(d.real), _rows(d.imag)])


def _rows(x: Array) -> Array:
    return x.reshape(-1, x.shape[-1])


def recursion(z: complex, forcing: Complex, start: Complex) -> tuple[Complex, Complex]:
    """x⁺ = z x + forcing along the last axis from `start`, and the x after the last one.

    Args:
        z: sampled pole.
        forcing: shape (…, n_samples).
        start: x at the first sample, shape (…).

    Returns:
        x at all samples, shape (…, n_samples), and behind the last, shape (…).
    """
    from scipy.signal import lfilter  # slow to load, and only simulations need it

    x, after = lfilter([0, 1], [1, -z], forcing, axis=-1, zi=start[..., None])
    return x, after[..., 0]


def _prediction(system: StateSpace, modes: Spectrum, run: Run, initial: Array | None) -> Array:
    """What each Re r, Im r and input counts in each output, shape (n_outputs, n_signals without s)."""
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


def _coefficients(
    tangent: Tangent, modes: Spectrum, run: Run, initial: Array | None, pairs: Pairs
) -> Iterator[Array]:
    """What each signal counts in the derivatives of each output, shape (n_parameters, n_signals).

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
