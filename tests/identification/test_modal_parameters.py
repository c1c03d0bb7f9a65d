"""Modal parameters: how many, the model they give back, and their derivatives."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from identification.errors import IdentificationError
from identification.modal_parameters import modal_parameters
from identification.parameterizations import central_differences
from identification.recording import Channel
from identification.systems import StateSpace
from tests import systems

CHAIN3 = systems.paper_chain3("coupled")


def overdamped():
    """A complex pair and two real poles."""
    A = scipy.linalg.block_diag([[0.9, 0.2], [-0.2, 0.9]], 0.5, -0.3)
    rng = np.random.default_rng(0)
    T = rng.standard_normal((4, 4))
    B, C = rng.standard_normal((4, 2)), rng.standard_normal((3, 4))
    outputs = tuple(Channel(f"y{i}", "m") for i in range(3))
    inputs = tuple(Channel(f"u{i}", "N") for i in range(2))
    return StateSpace(
        T @ A @ np.linalg.inv(T), T @ B, C @ np.linalg.inv(T), np.zeros((3, 2)), 0.1, inputs, outputs
    )


def same_response(a, b):
    f = np.linspace(0.01, 4, 30)
    H = b.frequency_response(f)
    # Two eigenvalue decompositions of well-conditioned matrices.
    np.testing.assert_allclose(a.frequency_response(f), H, atol=1e-12 * np.abs(H).max())


@pytest.mark.parametrize(
    ("system", "count"),
    [
        # n (m + l) + m l for the sampled chain: the number of parameters of any minimal system.
        (CHAIN3, 6 * 4 + 4),
        (overdamped(), 4 * 5),  # no direct term from force to displacement
        (systems.modes4(), 8 * 5 + 4),
    ],
)
def test_a_system_goes_in_and_comes_out(system, count):
    family = modal_parameters(system, inputs=system.inputs)
    theta = family.start(system)
    assert len(family.names) == len(set(family.names)) == theta.size == count
    assert not family.unknown.any()
    same_response(family.tangent(theta, system.inputs, system.outputs).system, system)


def test_continuous_systems_stay_continuous():
    system = CHAIN3.continuous()
    family = modal_parameters(system, inputs=system.inputs)
    found = family.tangent(family.values, system.inputs, system.outputs).system
    assert found.dt == 0
    same_response(found, system)


def test_derivatives():
    system = overdamped()
    family = modal_parameters(system, inputs=system.inputs)
    tangent = family.tangent(family.values, system.inputs, system.outputs)
    twin = central_differences(
        lambda x: family.tangent(x, system.inputs, system.outputs).system, np.array(family.values)
    )
    for name in "ABCD":
        # Linear in the parameters: differences are exact but for rounding over the step of 1e-5.
        np.testing.assert_allclose(
            getattr(tangent, f"{name}_theta"), getattr(twin, f"{name}_theta"), atol=1e-9
        )


def test_inputs_that_the_model_lacks_begin_with_no_part():
    inputs = (*CHAIN3.inputs, Channel("extra", "N"))
    family = modal_parameters(CHAIN3, inputs=inputs)
    system = family.tangent(family.values, inputs, CHAIN3.outputs).system
    assert not system.B[:, 2].any()
    assert family.unknown.sum() == 6 + 2  # participation of three complex poles, direct terms of two outputs
    fewer = modal_parameters(CHAIN3, inputs=inputs[:1])
    same_response(
        fewer.tangent(fewer.values, inputs[:1], CHAIN3.outputs).system,
        replace(CHAIN3, B=CHAIN3.B[:, :1], D=CHAIN3.D[:, :1], inputs=inputs[:1]),
    )


def test_modes_have_shapes_and_poles_only():
    modes = CHAIN3.modes()
    family = modal_parameters(modes, inputs=CHAIN3.inputs, dt=CHAIN3.dt)
    found = family.tangent(family.values, CHAIN3.inputs, CHAIN3.outputs).system.modes()
    np.testing.assert_allclose(found.poles, modes.poles, rtol=1e-12)
    np.testing.assert_allclose(found.normalized().shapes, modes.normalized().shapes, atol=1e-12)
    with pytest.raises(IdentificationError, match="give dt"):
        modal_parameters(modes, inputs=CHAIN3.inputs)


@pytest.mark.parametrize("dt", [0.0, 0.05])
def test_growing_poles_are_reflected(dt):
    poles = np.array([0.1 + 3j, -0.2 + 5j, 0.3])
    A = scipy.linalg.block_diag([[0.1, 3], [-3, 0.1]], [[-0.2, 5], [-5, -0.2]], 0.3)
    A = scipy.linalg.expm(A * dt) if dt else A
    system = StateSpace(
        A, np.ones((5, 1)), np.ones((1, 5)), [[0]], dt, (Channel("u", "N"),), (Channel("y", "m"),)
    )
    family = modal_parameters(system, inputs=system.inputs)
    calm = family.tangent(family.stable(family.values), system.inputs, system.outputs).system
    found = calm.eigen()[0]
    expected = -np.abs(poles.real) + 1j * poles.imag
    for pole in expected:
        assert np.min(np.abs(found - pole)) < 1e-12  # rounding of logarithm and exponential


def test_other_channels_are_refused():
    family = modal_parameters(CHAIN3, inputs=CHAIN3.inputs)
    with pytest.raises(
        IdentificationError, match="the model has outputs acceleration_x2, acceleration_x3 and the"
    ):
        family.tangent(family.values, CHAIN3.inputs, CHAIN3.outputs[::-1])
    with pytest.raises(IdentificationError, match="expected an array of 28 finite values"):
        family.start(np.zeros(3))
