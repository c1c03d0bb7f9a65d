"""Responses of a state space and of all its derivatives at once, mode by mode and exact for held inputs.

With A = Φ Λ Φ⁻¹ the outputs are sums of modal responses r, each the answer of one pole to one input. To first
order a change of parameters mixes the r, where it turns eigenvectors, and adds their derivatives s = ∂r/∂λ,
where it moves poles. So few signals span the derivatives with respect to any number of parameters, and the
normal equations need no more of the data than the products of these signals.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.linalg
import scipy.signal
from numpy.typing import NDArray

from identification.parameterizations import Tangent
from identification.recording import Array
from identification.systems import StateSpace

Complex = NDArray[np.complex128]
BLOCK = 1 << 14
ILL_CONDITIONED = 1e4


class Run(NamedTuple):
    """One record as the likelihood sees it.

    Attributes:
        inputs: those that act at all, shape (n_active, n_samples).
        active: their positions among the input channels.
        outputs: shape (n_outputs, n_samples).
        dt: sample time [s].
    """

    inputs: Array
    active: NDArray[np.intp]
    outputs: Array
    dt: float


class Spectrum(NamedTuple):
    """Poles and eigenvectors of A.

    Attributes:
        poles: all of them, as A has them: sampled or continuous, shape (n_states,).
        phi: eigenvectors Φ, shape (n_states, n_states).
        phi_inv: Φ⁻¹.
        own: positions of the poles that stand for themselves and their conjugates.
        twice: 2 for the poles that do, 1 for real ones, shape (n_own,).
    """

    poles: Complex
    phi: Complex
    phi_inv: Complex
    own: NDArray[np.intp]
    twice: Array


class Hold(NamedTuple):
    """r⁺ = z r + h u for a held input u, and the derivatives of z and h with respect to the pole."""

    z: Complex
    h: Complex
    dz: Complex
    dh: Complex


def spectrum(system: StateSpace) -> Spectrum | None:
    """Poles and eigenvectors; None where A has too few eigenvectors to work with, as at a critical damping."""
    poles, phi = scipy.linalg.eig(system.A)
    balanced = phi / np.maximum(np.linalg.norm(phi, axis=1, keepdims=True), np.finfo(float).tiny)
    balanced /= np.linalg.norm(balanced, axis=0)
    if np.linalg.cond(balanced) > ILL_CONDITIONED:
        return None
    own = np.flatnonzero(poles.imag >= 0)
    twice = np.where(poles[own].imag > 0, 2.0, 1.0)
    return Spectrum(
        poles.astype(complex), phi.astype(complex), np.linalg.inv(phi).astype(complex), own, twice
    )


def simulate(system: StateSpace, modes: Spectrum, run: Run, initial: Array | None) -> Array:
    """Outputs under the inputs of the run and from the initial state, shape (n_outputs, n_samples)."""
    weights = _prediction(system, modes, run, initial)
    blocks = [weights @ X for _, X in _signals(system, modes, run, initial is not None, derivative=False)]
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
    """
    predict = _prediction(tangent.system, modes, run, initial)
    G: Array = np.zeros(())  # products of the signals among themselves, (n_signals, n_signals)
    V: Array = np.zeros(())  # and with the residuals, (n_signals, n_outputs)
    for where, X in _signals(tangent.system, modes, run, initial is not None, derivative=True):
        residual = run.outputs[:, where] - predict @ X[: predict.shape[1]]
        G = G + X @ X.T
        V = V + X @ residual.T
    gradient, information = 0.0, 0.0
    for o, T in enumerate(_coefficients(tangent, modes, run, initial)):
        gradient = gradient + weights[o] * (T @ V[:, o])
        information = information + weights[o] * (T @ G @ T.T)
    return np.asarray(gradient), np.asarray(information)


def hold(poles: Complex, system_dt: float, dt: float) -> Hold:
    """How each pole answers an input held over dt: h = (e^λdt - 1) / λ, and z with h = 1 when sampled."""
    one = np.ones(poles.shape, dtype=np.complex128)
    if system_dt:
        return Hold(poles, one, one, 0 * one)
    x = poles * dt
    still = x == 0
    h = np.asarray(np.where(still, 1, np.expm1(x) / np.where(still, 1, x)), dtype=np.complex128)
    z: Complex = np.asarray(np.exp(x), dtype=np.complex128)
    return Hold(z, dt * h, dt * z, dt**2 * _slope(x))


def _slope(x: Complex) -> Complex:
    """Derivative of (eˣ - 1) / x: (eˣ - (eˣ - 1) / x) / x, near zero by its series Σ xᵏ / (k! (k + 2))."""
    small = np.abs(x) < 0.5
    far = np.where(small, 1, x)
    slope = (np.exp(far) - np.expm1(far) / far) / far
    near = np.where(small, x, 0)
    series, term = np.zeros_like(x), np.ones_like(x)
    for k in range(18):
        series = series + term / (k + 2)
        term = term * near / (k + 1)
    return np.where(small, series, slope)


def _signals(
    system: StateSpace, modes: Spectrum, run: Run, released: bool, *, derivative: bool
) -> Iterator[tuple[slice, Array]]:
    """Blocks of Re r and Im r of each own pole and source, the inputs themselves, then Re s and Im s.

    Sources are the active inputs and, when `released`, the initial state.
    """
    k = hold(modes.poles[modes.own], system.dt, run.dt)
    n_inputs, n_samples = run.inputs.shape
    n_sources = n_inputs + released
    r_next = np.zeros((len(k.z), n_sources), dtype=complex)
    r_next[:, n_inputs:] = 1
    s_next = np.zeros_like(r_next)
    for first in range(0, n_samples, BLOCK):
        where = slice(first, min(first + BLOCK, n_samples))
        u = run.inputs[:, where]
        forcing = np.concatenate([u, np.zeros((int(released), u.shape[1]))])
        r = np.empty((len(k.z), n_sources, u.shape[1]), dtype=complex)
        s = np.empty_like(r if derivative else r[:0])
        for i in range(len(k.z)):
            r[i], r_next[i] = recursion(k.z[i], k.h[i] * forcing, r_next[i])
            if derivative:
                s[i], s_next[i] = recursion(k.z[i], k.dz[i] * r[i] + k.dh[i] * forcing, s_next[i])
        yield where, np.concatenate([_rows(r.real), _rows(r.imag), u, _rows(s.real), _rows(s.imag)])


def _rows(x: Array) -> Array:
    return x.reshape(-1, x.shape[-1])


def recursion(z: complex, forcing: Complex, start: Complex) -> tuple[Complex, Complex]:
    """x⁺ = z x + forcing along the last axis from `start`, and the x after the last one."""
    x, after = scipy.signal.lfilter([0, 1], [1, -z], forcing, axis=-1, zi=start[..., None])
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


def _coefficients(tangent: Tangent, modes: Spectrum, run: Run, initial: Array | None) -> Iterator[Array]:
    """What each signal counts in the derivatives of each output, shape (n_parameters, n_signals).

    Source: first-order perturbation of eigenvalues and eigenvectors; poles closer than rounding allows to tell
    apart share the mean of their s, which is the divided difference of r to second order in the distance.
    """
    system, own = tangent.system, modes.own
    extra = 0 if initial is None else system.n_states
    dA = modes.phi_inv @ tangent.A_theta @ modes.phi
    near = _near(modes.poles, system.dt, run)
    gap = modes.poles[:, None] - modes.poles
    turn = np.where(near, 0, 1 / np.where(near, 1, gap))
    gamma, beta = system.C @ modes.phi, _beta(system, modes, run, initial)
    d_sources = tangent.B_theta[:, :, run.active]
    if initial is not None:
        d_sources = np.concatenate([d_sources, np.zeros((*d_sources.shape[:2], 1))], axis=2)
    d_gamma = (tangent.C_theta @ modes.phi + gamma @ (dA * turn.T))[:, :, own]
    d_beta = (modes.phi_inv @ d_sources + (dA * turn) @ beta)[:, own]
    s_gamma = (gamma @ (dA * near))[:, :, own] / 2
    s_beta = ((dA * near) @ beta)[:, own] / 2
    gamma, beta = gamma[:, own], beta[own]
    twice = modes.twice[:, None]
    for o in range(len(gamma)):
        g = gamma[o, :, None] * twice
        r = d_gamma[:, o, :, None] * twice * beta + g * d_beta  # (n_parameters, n_own, n_sources)
        s = s_gamma[:, o, :, None] * twice * beta + g * s_beta
        parts = (r.real, -r.imag, tangent.D_theta[:, o, run.active], s.real, -s.imag)
        T = np.concatenate([x.reshape(len(r), -1) for x in parts], axis=1)
        yield np.concatenate([T, _of_initial(g * modes.phi_inv[own], beta.shape, T.shape[1])]) if extra else T


def _of_initial(answer: Complex, sources: tuple[int, ...], n_signals: int) -> Array:
    """Rows of the initial states: they drive the last source through the modes, answer (n_own, n_states)."""
    rows = np.zeros((answer.shape[1], *sources), dtype=complex)
    rows[:, :, -1] = answer.T
    size = sources[0] * sources[1]
    T = np.zeros((answer.shape[1], n_signals))
    T[:, :size], T[:, size : 2 * size] = (x.reshape(len(rows), -1) for x in (rows.real, -rows.imag))
    return T


def _near(poles: Complex, system_dt: float, run: Run) -> NDArray[np.bool_]:
    """Pairs of poles (and each with itself) that do not drift apart while their responses last."""
    size = np.maximum(np.abs(poles), np.finfo(float).tiny)
    rate = np.minimum(np.abs(np.log(size)), 1) if system_dt else np.abs(poles.real)
    lasting = run.outputs.shape[1] * (1.0 if system_dt else run.dt)
    return np.asarray(np.abs(poles[:, None] - poles) < 1e-5 * (rate + 1 / lasting))
