"""How a pole answers an input held over each sample: r⁺ = z r + h u, and what becomes of z and h as poles move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Exact to rounding for the integrands below, which vary little over a sample."""


def hold(poles: Complex, system_dt: float, dt: float) -> tuple[Complex, Complex]:
    """The factors z = e^λdt and h = ∫ e^λt dt over one sample for each pole; z and 1 for those of a sampled model.

    Args:
        poles: λ [rad/s], or z.
        system_dt: zero for a continuous model.
        dt: sample time [s].

    Returns:
        Two arrays, shape (n_poles,) each.

    Source: Åström and Wittenmark (1997), Computer-Controlled Systems, 3rd ed., section 2.3.
    """
    if system_dt:
        return poles, np.ones(poles.shape, dtype=np.complex128)
    return np.asarray(np.exp(poles * dt)), dt * _phi(poles * dt)


def divided_hold(a: Complex, b: Complex, system_dt: float, dt: float) -> tuple[Complex, Complex]:
    """(z_a - z_b) / (λ_a - λ_b) and (h_a - h_b) / (λ_a - λ_b), or the derivatives where the poles coincide.

    Args:
        a: poles, one of each pair.
        b: the others, shape of a.
        system_dt: zero for a continuous model.
        dt: sample time [s].

    Nothing cancels: z_a - z_b = z_b (e^(λ_a - λ_b)dt - 1), and h follows from λ h = z - 1 for fast poles, from
    ∫ t e^λ_b t φ((λ_a - λ_b) t) dt over one sample for slow ones.

    Returns:
        Two arrays, shape (n_pairs,) each.

    Source: Van Loan (1978), IEEE Trans. Autom. Control 23(3), 395-404: the derivative of an exponential as an
        integral.
    """
    if system_dt:
        return np.ones(a.shape, dtype=np.complex128), np.zeros(a.shape, dtype=np.complex128)
    x, y = a * dt, b * dt
    z = np.exp(y) * _phi(x - y)
    slow = np.abs(x) < 1
    t = (NODES + 1) / 2
    inner = np.where(slow, y, 0)[..., None] * t
    by_integral = np.sum(WEIGHTS / 2 * t * np.exp(inner) * _phi((x - y)[..., None] * t), axis=-1)
    by_balance = (z - _phi(y)) / np.where(slow, 1, x)
    return dt * z, np.asarray(dt**2 * np.where(slow, by_integral, by_balance), dtype=np.complex128)


def _phi(x: Complex) -> Complex:
    """φ(x) = (eˣ - 1) / x, one at zero."""
    still = x == 0
    return np.asarray(np.where(still, 1, np.expm1(x) / np.where(still, 1, x)), dtype=np.complex128)
