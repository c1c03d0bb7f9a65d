"""The factors of a zero-order hold against quadrature, for slow, fast, close and coinciding poles."""

import numpy as np
import pytest

from identification.zero_order_hold import divided_hold, hold

DT = 0.05
POLES = [0.0, 1e-12, -1e-3 + 1e-3j, -0.999 / DT, -1.001 / DT, -3 + 40j, -0.1 + 62j]


def over_one_sample(function):
    """Integral by Gauss-Legendre quadrature with more nodes than the integrands need: exact to rounding."""
    x, w = np.polynomial.legendre.leggauss(60)
    return np.sum(w * DT / 2 * function(DT * (x + 1) / 2))


@pytest.mark.parametrize("pole", POLES)
def test_hold_is_the_integral_of_the_exponential(pole):
    z, h = hold(np.array([pole], dtype=complex), 0.0, DT)
    np.testing.assert_allclose(z[0], np.exp(pole * DT), rtol=1e-15)
    np.testing.assert_allclose(h[0], over_one_sample(lambda t: np.exp(pole * t)), rtol=1e-13)


@pytest.mark.parametrize("apart", [0, 1e-13, 1e-6j, 1e-3, 0.1 + 0.1j])
@pytest.mark.parametrize("pole", POLES)
def test_differences_of_poles_are_divided_without_loss(pole, apart):
    a, b = np.array([pole + apart], dtype=complex), np.array([pole], dtype=complex)
    # e^at - e^bt over a - b is the integral of t e^{b t + s (a - b) t} over s from 0 to 1.
    s, w = np.polynomial.legendre.leggauss(20)

    def divided(t):
        inner = np.exp(np.multiply.outer(b[0] + (a[0] - b[0]) * (s + 1) / 2, t))
        return t * np.sum(w[:, None] / 2 * inner, axis=0)

    dz, dh = divided_hold(a, b, 0.0, DT)
    np.testing.assert_allclose(dz[0], divided(np.array([DT]))[0], rtol=1e-13)
    # Just above |λ| dt = 1 the balance z = 1 + λ h loses a digit.
    np.testing.assert_allclose(dh[0], over_one_sample(divided), rtol=1e-13)


def test_stiff_poles():
    z, h = hold(np.array([-1e5 + 0j]), 0.0, DT)
    assert z[0] == 0
    np.testing.assert_allclose(h[0], 1e-5, rtol=1e-15)
    dz, dh = divided_hold(np.array([-1e5 + 0j]), np.array([-1e5 + 0j]), 0.0, DT)
    assert dz[0] == 0
    np.testing.assert_allclose(dh[0], 1e-10, rtol=1e-15)  # ∫ t e^{-at} dt = 1 / a²


def test_sampled_poles_are_what_they_are():
    z, h = hold(np.array([0.9 + 0.1j]), DT, DT)
    dz, dh = divided_hold(np.array([0.9 + 0.1j]), np.array([0.8 + 0.1j]), DT, DT)
    assert (z[0], h[0], dz[0], dh[0]) == (0.9 + 0.1j, 1, 1, 0)
