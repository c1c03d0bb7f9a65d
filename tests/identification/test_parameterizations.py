"""Any state space as a function of parameters, with derivatives given or by differences."""

import numpy as np
import pytest

from identification.errors import IdentificationError
from identification.parameterizations import Custom, Tangent, central_differences
from identification.recording import Channel
from identification.systems import StateSpace

INPUTS, OUTPUTS = (Channel("u", "N"),), (Channel("y", "m"),)


def oscillator(theta):
    omega, zeta = theta
    A = [[0, 1], [-(omega**2), -2 * zeta * omega]]
    return StateSpace(A, [[0], [1]], [[1, 0]], [[0]], 0.0, INPUTS, OUTPUTS)


def slopes(theta):
    omega, zeta = theta
    dA = [[[0, 0], [-2 * omega, -2 * zeta]], [[0, 0], [0, -2 * omega]]]
    return Tangent(oscillator(theta), dA, np.zeros((2, 2, 1)), np.zeros((2, 1, 2)), np.zeros((2, 1, 1)))


@pytest.mark.parametrize("theta", [(3.0, 0.02), (3e4, 0.02), (2.0, 0.0)])
def test_differences_are_derivatives(theta):
    found = central_differences(oscillator, np.array(theta))
    exact = slopes(theta)
    # A is quadratic in each parameter: no error but rounding over steps of 6e-6 of the parameter.
    np.testing.assert_allclose(found.A_theta, exact.A_theta, atol=1e-9 * np.abs(exact.A_theta).max())
    np.testing.assert_array_equal(found.system.A, exact.system.A)


def test_given_derivatives_are_used():
    plain = Custom(("omega", "zeta"), oscillator)
    exact = Custom(("omega", "zeta"), oscillator, slopes)
    theta = plain.start([3.0, 0.02])
    a, b = (family.tangent(theta, INPUTS, OUTPUTS) for family in (plain, exact))
    np.testing.assert_array_equal(b.A_theta, slopes(theta).A_theta)
    np.testing.assert_allclose(a.A_theta, b.A_theta, atol=1e-8)


@pytest.mark.parametrize("start", [np.zeros(3), [1.0], [1.0, np.nan], oscillator((1, 0.1))])
def test_starts_that_are_no_parameters(start):
    with pytest.raises(IdentificationError, match="expected an array of 2 finite values for omega, zeta"):
        Custom(("omega", "zeta"), oscillator).start(start)


def test_channels_must_be_those_of_the_recording():
    with pytest.raises(IdentificationError, match="the model has inputs u and the recording none"):
        Custom(("omega", "zeta"), oscillator).tangent(np.array([3.0, 0.02]), (), OUTPUTS)


def test_slopes_of_the_wrong_shape():
    with pytest.raises(IdentificationError, match=r"B_theta has shape \(2, 1, 1\); expected \(2, 2, 1\)"):
        Tangent(
            oscillator((1, 0.1)),
            np.zeros((2, 2, 2)),
            np.zeros((2, 1, 1)),
            np.zeros((2, 1, 2)),
            np.zeros((2, 1, 1)),
        )
