"""The few signals that span the responses of a state space and all their derivatives, mode by mode.

The modal responses r answer one input through one pole each; the divided differences d = (r_a - r_b) / (λ_a - λ_b) of
poles that are close, ∂r/∂λ of each with itself among them, stand for the derivatives that poles bring.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

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


def signals(
    system: StateSpace, modes: Spectrum, run: Run, released: bool, pairs: Pairs | None
) -> Iterator[tuple[slice, Array]]:
    """Blocks of Re r and Im r of each own pole and source, the inputs themselves, then Re d and Im d of each pair.

    Args:
        system: the model.
        modes: its spectrum.
        run: the record.
        released: whether the initial state is a source too, behind the active inputs.
        pairs: poles whose d are asked for; none when None.

    Yields:
        Where in the record a block lies, and its signals, shape (n_signals, n_block).

    Source: Åström and Wittenmark (1997), Computer-Controlled Systems, 3rd ed., section 2.3, one pole at a time; Van Loan
        (1978), IEEE Trans. Autom. Control 23(3), 395-404, for d.
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
