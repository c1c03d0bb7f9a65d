"""Shapes and residues from frequency responses, once the poles are known: linear least squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.errors import IdentificationError, TooShortError
from identification.modal_form import modal_outputs, modal_states
from identification.modes import Modes
from identification.recording import DERIVATIVE, Array, Channel
from identification.response import FrequencyResponse
from identification.systems import StateSpace

Complex = NDArray[np.complex128]


class OutputFit(NamedTuple):
    """Output matrices and what they leave.

    Attributes:
        C: shape (n_outputs, n_states).
        D: shape (n_outputs, n_inputs).
        misfit: Σ w² |H - C X - D|² of each output over all lines and inputs, shape (n_outputs,).
    """

    C: Array
    D: Array
    misfit: Array


def fit_outputs(response: FrequencyResponse, states: Complex) -> OutputFit:
    """C and D with H(f) = C X(f) + D in the sense of weighted least squares over all lines and inputs.

    Args:
        response: H.
        states: X = (z I - A)⁻¹ B, shape (n_frequencies, n_states, n_inputs).

    Returns:
        C, D and what is left of each output.

    Source: Peeters and Van der Auweraer (2005), Proc. 1st IOMAC, eq. (9), with all poles of the polynomial
        in place of residual terms.
    """
    n_f, n_states, n_inputs = states.shape
    direct = np.broadcast_to(np.eye(n_inputs), (n_f, n_inputs, n_inputs))
    w = line_weights(response)[:, None, None]
    X = w * np.concatenate([states, direct], axis=1)  # (n_frequencies, n_states + n_inputs, n_inputs)
    rows, Y = (M.transpose(0, 2, 1).reshape(n_f * n_inputs, -1) for M in (X, w * response.values))
    theta, misfit = _least_squares(rows.astype(complex), Y)
    return OutputFit(theta[:n_states].T, theta[n_states:].T, misfit)


def line_weights(response: FrequencyResponse) -> Array:
    """Weight of each line, equal where the response has none, shape (n_frequencies,).

    Args:
        response: with its own weights or without.

    Returns:
        Relative to one another.
    """
    return np.ones(response.frequency_hz.size) if response.weight is None else response.weight


@dataclass(frozen=True, eq=False, repr=False)
class Residues:
    """H(z) = Σ_m R_m / (z - z_m) + conjugate + residual terms, with z = exp(i 2π f dt).

    Attributes:
        poles: λ [rad/s], one of each conjugate pair, shape (n_modes,).
        values: R_m, shape (n_modes, n_outputs, n_inputs).
        direct: D, the constant part of the response, shape (n_outputs, n_inputs).
        lower: mass line of the modes below the band, L in (iω)^q L / (iω)², shape (n_outputs, n_inputs).
        upper: stiffness line of the modes above the band, U in (iω)^q U, likewise; q is the number of time
            derivatives between displacement and the output.
        dt: sample time [s].
        inputs: input channels.
        outputs: output channels.
    """

    poles: Complex
    values: Complex
    direct: Array
    lower: Array
    upper: Array
    dt: float
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]

    def factors(self) -> tuple[Complex, Complex]:
        """Shapes (n_outputs, n_modes) and participation (n_modes, n_inputs) of the nearest R_m = φ_m l_m.

        The participation has length one. A mode that all inputs drive has a residue of rank one; the
        singular values tell how nearly.
        """
        U, s, Vh = np.linalg.svd(self.values, full_matrices=False)
        return (U[:, :, 0] * s[:, :1]).T, Vh[:, 0]

    def modes(self) -> Modes:
        """Frequency, damping and shape."""
        return Modes.from_poles(self.poles, self.factors()[0], self.outputs)

    def state_space(self) -> StateSpace:
        """Sampled model of the modes and the constant part, two states per mode; the residual lines stay out."""
        shapes, participation = self.factors()
        z = np.exp(self.poles * self.dt)
        A, B = modal_states(z, participation)
        return StateSpace(A, B, modal_outputs(z, shapes), self.direct, self.dt, self.inputs, self.outputs)

    def frequency_response(self, frequency_hz: Array) -> Complex:
        """H with the residual terms, shape (n_frequencies, n_outputs, n_inputs)."""
        f = np.asarray(frequency_hz, dtype=float)
        g, h = _kernels(self.poles, f, self.dt)
        H = np.tensordot(g, self.values, 1) + np.tensordot(h, self.values.conj(), 1) + self.direct
        lines = _residual_lines(f, self.outputs) if self.lower.any() or self.upper.any() else []
        for o, (low, high) in enumerate(lines):
            H[:, o] += low[:, None] * self.lower[o] + high[:, None] * self.upper[o]
        return np.asarray(H)

    def __repr__(self) -> str:
        return f"Residues({self.poles.size} modes, {len(self.outputs)} outputs, {len(self.inputs)} inputs)"


def lsfd(response: FrequencyResponse, modes: Modes, *, residuals: bool = False) -> Residues:
    """Residues of known poles that fit frequency responses best.

    Args:
        response: the lines to fit; `between` chooses a band.
        modes: the poles; their shapes are not used.
        residuals: add a mass line and a stiffness line for the modes below and above the lines given, in
            place of the constant that suits the whole band.

    Returns:
        Residues, from which shapes, participation and a state-space model follow.

    Raises:
        TooShortError: fewer lines than unknowns.
        IdentificationError: residual lines for outputs that measure no motion, or at 0 Hz.

    Source: Heylen, Lammens and Sas (1997), Modal Analysis Theory and Testing, sections A.3.3 and A.4.4,
        least-squares frequency domain; Peeters and Van der Auweraer (2005), Proc. 1st IOMAC, eq. (9).
    """
    f, H = response.frequency_hz, response.values
    n_f, n_outputs, n_inputs = H.shape
    n_modes = len(modes)
    if 2 * n_f < 2 * n_modes + 2:
        raise TooShortError(f"{n_f} lines cannot carry {n_modes} modes; widen the band or leave modes out")
    # An exponential window on the data has moved the poles; the residues refer to the unmoved ones.
    poles = modes.poles
    shift = np.exp(response.decay * response.dt)
    g, h = _kernels(poles - response.decay, f, response.dt)
    unknown = np.stack([g + h, 1j * (g - h)], axis=2).reshape(n_f, -1)
    direct = np.zeros((n_outputs, n_inputs))
    lower, upper = direct.copy(), direct.copy()
    R = np.empty((n_modes, n_outputs, n_inputs), complex)
    lines = _residual_lines(f, response.outputs) if residuals else [(np.ones(n_f, complex),)] * n_outputs
    w = line_weights(response)[:, None]
    for o, extra in enumerate(lines):
        X = np.column_stack([unknown, *extra])
        solution = _least_squares(w * X, w * H[:, o])[0]
        R[:, o] = shift * (solution[0 : 2 * n_modes : 2] + 1j * solution[1 : 2 * n_modes : 2])
        if residuals:
            lower[o], upper[o] = solution[2 * n_modes :]
        else:
            direct[o] = solution[-1]
    return Residues(poles, R, direct, lower, upper, response.dt, response.inputs, response.outputs)


def _kernels(poles: Complex, f: Array, dt: float) -> tuple[Complex, Complex]:
    """1 / (z - z_m) of every pole and of its conjugate, shape (n_frequencies, n_modes)."""
    z, z_m = np.exp(2j * np.pi * f * dt)[:, None], np.exp(poles * dt)
    return 1 / (z - z_m), 1 / (z - z_m.conj())


def _residual_lines(f: Array, outputs: tuple[Channel, ...]) -> list[tuple[Complex, Complex]]:
    """Mass and stiffness line of each output: (iω)^{q-2} and (iω)^q."""
    still = [channel.name for channel in outputs if channel.quantity not in DERIVATIVE]
    if still or f[0] <= 0:
        given = f"output {still[0]!r} measures no motion" if still else "the lines begin at 0 Hz"
        raise IdentificationError(
            f"residual lines need outputs that measure motion, above 0 Hz, and {given}; "
            "choose the band with `between`, or leave `residuals` off"
        )
    s = np.asarray(2j * np.pi * f, dtype=np.complex128)
    powers = [DERIVATIVE[channel.quantity] for channel in outputs]
    return [(np.asarray(s ** (q - 2)), np.asarray(s**q)) for q in powers]


def _least_squares(X: Complex, Y: Complex) -> tuple[Array, Array]:
    """Real θ with X θ = Y, the columns of X brought to one length first, and the misfit of each column of Y.

    Normal equations with one step of refinement are fast and lose nothing while the columns are well apart;
    otherwise an orthogonal factorization follows.
    """
    lhs, rhs = np.vstack([X.real, X.imag]), np.vstack([Y.real, Y.imag])
    length = np.linalg.norm(lhs, axis=0)
    length[length == 0] = 1
    lhs /= length
    L, info = scipy.linalg.lapack.dpotrf(lhs.T @ lhs, lower=1, clean=1)
    if info == 0 and np.min(np.diag(L)) > 1e-4:
        theta = scipy.linalg.cho_solve((L, True), lhs.T @ rhs)
        theta += scipy.linalg.cho_solve((L, True), lhs.T @ (rhs - lhs @ theta))
    else:
        Q, R = scipy.linalg.qr(lhs, mode="economic")
        theta = scipy.linalg.lstsq(R, Q.T @ rhs)[0]
    misfit = np.sum((rhs - lhs @ theta) ** 2, axis=0)
    return np.asarray(theta / length[:, None]), np.asarray(misfit)
