"""The builders against the printed tables, and the core types against closed forms."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st

from identification.errors import IdentificationError, OrderError
from identification.recording import Channel
from identification.systems import MarkovParameters, Realization, SecondOrder, StateSpace
from tests import systems


def test_chain3_is_the_printed_one():
    coupled = systems.chain3("coupled")
    np.testing.assert_allclose(coupled.damping, [[0.5, -0.1, -0.2], [-0.1, 0.7, -0.3], [-0.2, -0.3, 0.6]])
    np.testing.assert_allclose(coupled.stiffness, 5 * np.eye(3) - 1)
    np.testing.assert_allclose(systems.chain3().damping, 0.1 * coupled.stiffness)


def test_truss_is_the_printed_one():
    # De Angelis et al. (2002), Table 8, printed to one decimal.
    K = systems.truss().stiffness
    np.testing.assert_allclose(np.diag(K), [27071.1, 17071.1] * 4, atol=0.05)
    np.testing.assert_allclose(K[0], [27071.1, 0, 0, 0, -10000, 0, -3535.5, -3535.5], atol=0.05)
    np.testing.assert_allclose(K[3], [0, -10000, 0, 17071.1, 3535.5, -3535.5, 0, 0], atol=0.05)
    C = systems.truss().damping
    np.testing.assert_allclose(C[5], [0, 0, 17.7, -17.7, 0, 86.4, 0, -50.0], atol=0.05)


def test_chain7_has_the_printed_modes():
    # Cambraia and Kurka (2010), Table 2; half a unit of the last printed digit.
    modes = systems.chain7().modes()
    printed = [1.6636, 4.9182, 7.9577, 10.6495, 12.8759, 14.5395, 15.5677]
    np.testing.assert_allclose(modes.frequency_hz, printed, atol=6e-5)
    np.testing.assert_allclose(modes.damping_ratio[[0, 6]], [0.0052, 0.0489], atol=5e-5)


def test_sampled_model_is_the_convolution_of_a_held_force():
    # One mass on a spring: the closed form of the response to a force held over the first sample.
    one = SecondOrder([[2.0]], [[0.6]], [[50.0]], ("x",))
    model = systems.instrumented(one, systems.sensors(["x"], "displacement"), systems.actuators(["x"]))
    dt = 0.1
    h = model.sampled(dt).markov(40).values[:, 0, 0]
    zeta, omega = 0.6 / (2 * np.sqrt(100)), 5.0
    damped = omega * np.sqrt(1 - zeta**2)
    t = dt * np.arange(40)
    rise = np.exp(-zeta * omega * t) * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))
    step = (1 - rise) / 50
    # Differences of a step response of size 1/50: rounding leaves 1e-17.
    np.testing.assert_allclose(h[1:], np.diff(step), atol=1e-16)


@given(st.integers(0, 10_000), st.floats(0.01, 0.2))
def test_continuous_undoes_sampled(seed, dt):
    rng = np.random.default_rng(seed)
    structure = systems.chain3("coupled")
    model = systems.instrumented(structure, systems.sensors(structure.dofs), systems.actuators(["x1"]))
    T = rng.standard_normal((6, 6)) + 3 * np.eye(6)
    model = StateSpace(
        np.linalg.solve(T, model.A @ T),
        np.linalg.solve(T, model.B),
        model.C @ T,
        model.D,
        0.0,
        model.inputs,
        model.outputs,
    )
    back = model.sampled(dt).continuous()
    # The logarithm divides the rounding by dt; the change of state multiplies it by its condition.
    scale = 1e-13 * np.linalg.cond(T) ** 2 / dt
    np.testing.assert_allclose(back.A, model.A, atol=scale * np.abs(model.A).max())
    np.testing.assert_allclose(back.B, model.B, atol=scale * np.abs(model.A).max())


def test_frequency_response_of_the_sampled_model_is_the_transform_of_its_pulse_response():
    model = systems.paper_chain3("coupled")
    n = 8192  # the slowest mode has decayed to 1e-27 by then
    frequencies = np.fft.rfftfreq(n, model.dt)
    expected = np.fft.rfft(model.markov(n).values, axis=0)
    picked = slice(1, None, 512)
    np.testing.assert_allclose(model.frequency_response(frequencies[picked]), expected[picked], atol=1e-11)


def test_simulation_equals_the_convolution_with_the_markov_parameters():
    model = systems.paper_chain3()
    u = np.random.default_rng(3).standard_normal((2, 60))
    Y = model.markov(60).values
    expected = [sum(Y[k - j] @ u[:, j] for j in range(k + 1)) for k in range(60)]
    np.testing.assert_allclose(model.simulate(u), np.transpose(expected), atol=1e-13)


def test_second_order_modes_solve_the_quadratic_eigenproblem():
    structure = systems.chain3("coupled")
    modes = structure.modes()
    for pole, shape in zip(modes.poles, modes.shapes.T, strict=True):
        residual = (pole**2 * structure.mass + pole * structure.damping + structure.stiffness) @ shape
        assert np.abs(residual).max() < 1e-13 * np.abs(structure.stiffness).max()


def test_static_response_is_the_flexibility():
    structure = systems.truss()
    model = systems.instrumented(
        structure, systems.sensors(structure.dofs, "displacement"), systems.actuators(structure.dofs)
    )
    np.testing.assert_allclose(
        model.frequency_response(np.array([0.0]))[0],
        scipy.linalg.inv(structure.stiffness),
        rtol=1e-11,
        atol=1e-17,
    )


def test_markov_needs_a_sampled_model():
    model = systems.instrumented(systems.chain3(), systems.sensors(["x1"]), systems.actuators(["x1"]))
    with pytest.raises(IdentificationError, match="sampled"):
        model.markov(3)


def test_wrong_shapes_are_named():
    with pytest.raises(IdentificationError, match=r"expected \(n_lags, 1, 1\)"):
        MarkovParameters(np.zeros((4, 2, 1)), 0.1, (Channel("u", "N"),), (Channel("y", "m"),))


def test_a_realization_names_the_orders_it_has():
    model = systems.paper_chain3()
    with pytest.raises(OrderError, match="there are 6"):
        Realization("era", (model,), np.ones(6), 8, {})
