"""Denominator polynomials of every degree, from one reduced least-squares problem.

The responses H(f) = N(z) D(z)⁻¹ share the right denominator D = I + A_1 z + … + A_p zᵖ. At each line and for
each output N_o(z) - H_o(f) D(z) = 0 is linear in the coefficients. Those of N_o concern one output only and
are eliminated; what is left are p n_inputs² unknowns, however many outputs there are.

With the constant coefficient fixed, poles that only fit the noise fall outside the unit circle, where no
structure has any.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.recording import Array

Complex = NDArray[np.complex128]


def reduced_factor(values: Complex, points: Complex, weight: Array, degree: int) -> Array:
    """Triangular factor R of what is left when the numerators are eliminated: |R (A_1; …; A_p; I)|² is least.

    The normal equations are fast, but squaring the data loses what is below √ε of them. When that much is
    needed, the data are nearly free of noise and an orthogonal factorization follows.

    Args:
        values: H, shape (n_frequencies, n_outputs, n_inputs).
        points: z of each line, on the unit circle, shape (n_frequencies,).
        weight: of each equation, shape (n_frequencies, n_outputs).
        degree: p.

    Returns:
        Upper triangle, shape ((p + 1) n_inputs, (p + 1) n_inputs); the leading columns serve lower degrees.

    Source: Guillaume, Verboven, Vanlanduit, Van der Auweraer and Peeters (2003), Proc. 21st IMAC, eq. (9) to
        (16); Cauberghe, Guillaume, Verboven, Vanlanduit and Parloo (2005), Mech. Syst. Signal Process.
        19(5), for the coefficient that is fixed.
    """
    n_inputs = values.shape[2]
    try:
        M = np.roll(_normal_matrix(values, points, weight, degree), -n_inputs, axis=(0, 1))  # A_0 = I last
        power = np.linalg.eigvalsh(M)
        if power[0] > 1e3 * power.size * np.finfo(float).eps * power[-1]:
            return np.asarray(scipy.linalg.cholesky(M))
    except scipy.linalg.LinAlgError:  # lines that leave out much of the circle do not tell the numerators
        pass
    return _orthogonal_factor(values, points, weight, degree)


def _normal_matrix(values: Complex, points: Complex, weight: Array, degree: int) -> Array:
    """M = Σ_o T_o - S_oᵀ R_o⁻¹ S_o, by blocks of A_0, A_1, …; all three are block Toeplitz matrices."""
    n_f, n_outputs, n_inputs = values.shape
    n = (degree + 1) * n_inputs
    w2 = weight**2
    z = points ** np.arange(-degree, degree + 1)[:, None]  # (2 degree + 1, n_frequencies)
    HwH = np.einsum("foi,fo,foj->fij", values.conj(), w2, values).reshape(n_f, -1)
    M = _toeplitz((z @ HwH).real.reshape(-1, n_inputs, n_inputs))
    r = (z @ w2).real  # (2 degree + 1, n_outputs)
    s = -(z @ (w2[:, :, None] * values).reshape(n_f, -1)).real.reshape(-1, n_outputs, n_inputs)
    for o in range(n_outputs):
        L = scipy.linalg.cholesky(_toeplitz(r[:, o, None, None]), lower=True)
        X = scipy.linalg.solve_triangular(L, _toeplitz(s[:, o, None]), lower=True)
        M -= X.T @ X
    return np.asarray(M).reshape(n, n)


def _toeplitz(blocks: Array) -> Array:
    """Matrix with block (r, s) = blocks[p + s - r], where p is the middle one."""
    p = len(blocks) // 2
    rows = np.arange(p + 1)
    full = blocks[p + rows - rows[:, None]]  # (p + 1, p + 1, height, width)
    return np.asarray(full.transpose(0, 2, 1, 3).reshape((p + 1) * blocks.shape[1], -1))


def _orthogonal_factor(values: Complex, points: Complex, weight: Array, degree: int) -> Array:
    """R of the equations themselves, output after output."""
    n_outputs, n_inputs = values.shape[1:]
    z = points[:, None] ** np.arange(degree + 1)
    R = np.zeros((0, (degree + 1) * n_inputs))
    for o in range(n_outputs):
        wz = weight[:, o, None] * z
        Q = scipy.linalg.qr(_real(wz), mode="economic")[0]
        lines = -wz[:, np.r_[1 : degree + 1, 0], None] * values[:, None, o]
        Y = _real(lines.reshape(len(z), -1))
        Y -= Q @ (Q.T @ Y)
        Y -= Q @ (Q.T @ Y)  # the second time removes what rounding left of a near cancellation
        R = scipy.linalg.qr(np.vstack([R, Y]), mode="r")[0][: R.shape[1]]
    return R


def _real(X: Complex) -> Array:
    return np.vstack([X.real, X.imag])


def coefficients(R: Array, n_inputs: int, degree: int) -> Array:
    """A_1, …, A_q of the denominator of degree q, shape (q, n_inputs, n_inputs).

    Where the data do not determine all of them, as those of a system of lower degree, the smallest ones.

    Args:
        R: factor of `reduced_factor`, for this degree or a higher one.
        n_inputs: size of a coefficient.
        degree: q.

    Returns:
        Real matrices.

    Source: Guillaume, Verboven, Vanlanduit, Van der Auweraer and Peeters (2003), Proc. 21st IMAC, the reduced
        normal equations, with the last coefficient as the unit matrix.
    """
    n = degree * n_inputs
    lhs, rhs = R[:n, :n], -R[:n, -n_inputs:]
    size = np.abs(np.diag(lhs))
    if np.min(size) > 1e-10 * np.max(size):
        A = scipy.linalg.solve_triangular(lhs, rhs)
    else:
        A = scipy.linalg.lstsq(lhs, rhs, cond=10 * R.shape[0] * np.finfo(float).eps)[0]
    return np.asarray(A).reshape(degree, n_inputs, n_inputs)


def zeros(A: Array) -> tuple[Complex, Complex]:
    """Points z with wᵀ D(z) = 0 and those w, one of each conjugate pair, for D = I + A_1 z + … + A_q z^q.

    Args:
        A: the coefficients A_1, …, A_q, shape (q, n_inputs, n_inputs).

    Returns:
        z, shape (n,), those with a positive imaginary part and the real ones, and w, shape (n, n_inputs).
        Zeros near infinity are put at `FAR`: from the unit circle the difference does not show.

    Source: Peeters and Van der Auweraer (2005), Proc. 1st IOMAC, eq. (8), for the reciprocals 1 / z.
    """
    degree, n_inputs, _ = A.shape
    companion = np.eye(degree * n_inputs, k=-n_inputs)
    companion[:n_inputs] = -A.transpose(2, 0, 1).reshape(n_inputs, -1)
    mu, V = scipy.linalg.eig(companion)
    own = mu.imag <= 0
    mu, W = mu[own], V[-n_inputs:, own].T
    near = np.maximum(np.abs(mu), 1 / FAR)
    turn = np.where(mu == 0, 1, mu) / np.where(mu == 0, 1, np.abs(mu))
    length = np.linalg.norm(W, axis=1, keepdims=True)
    return np.asarray(turn.conj() / near), W / np.where(length == 0, 1, length)


FAR = 1e3
