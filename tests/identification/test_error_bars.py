"""Error bars of functions of parameters, and of what cannot be told apart."""

import numpy as np
import pytest

from identification.error_bars import covariance_of, delta_method, modes_with_std
from identification.modal_parameters import modal_parameters
from identification.structures import free_matrices
from tests import systems
from tests.systems import actuators, sensors


def test_delta_method_is_the_variance_of_linear_functions():
    rng = np.random.default_rng(0)
    X, J = rng.standard_normal((50, 3)), rng.standard_normal((4, 3))
    # The sample covariance of linear functions is exactly J Σ Jᵀ.
    np.testing.assert_allclose(delta_method(np.cov(X.T), J), np.std(X @ J.T, axis=0, ddof=1), rtol=1e-12)


@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e8])
def test_sums_that_are_known_though_their_parts_are_not(scale):
    # Data see a + b and c only; units differ by `scale`.
    J = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) / [1.0, 1.0, scale]
    covariance, blind = covariance_of(J.T @ J, 3)
    assert blind.shape == (3, 1)
    functions = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 0]])
    std = delta_method(covariance, functions, blind=blind)
    np.testing.assert_allclose(std, [np.inf, np.inf, scale, 1.0, np.inf], rtol=1e-10)


def test_nuisance_is_eliminated():
    rng = np.random.default_rng(1)
    X = rng.standard_normal((20, 5))
    covariance, blind = covariance_of(X.T @ X, 2)
    assert blind.shape == (2, 0)
    np.testing.assert_allclose(covariance, np.linalg.inv(X.T @ X)[:2, :2], rtol=1e-10)


def test_what_is_only_seen_through_nuisance_is_blind():
    information = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 4.0]])
    covariance, blind = covariance_of(information, 1)
    assert delta_method(covariance, np.eye(1), blind=blind)[0] == np.inf


def families():
    structure = systems.chain3("coupled")
    yield free_matrices(structure.dofs), structure, actuators(("x1", "x2")), sensors(("x2", "x3"))
    sampled = systems.paper_chain3("coupled")
    yield modal_parameters(sampled, inputs=sampled.inputs), sampled, sampled.inputs, sampled.outputs


@pytest.mark.parametrize(
    ("family", "model", "inputs", "outputs"), list(families()), ids=["structure", "sampled modes"]
)
def test_error_bars_of_modes_equal_those_by_differences(family, model, inputs, outputs):
    theta = family.start(model)
    rng = np.random.default_rng(2)
    X = 0.01 * rng.standard_normal((theta.size, theta.size))
    covariance = X @ X.T

    def values(x):
        modes = family.tangent(x, inputs, outputs).system.modes()
        return np.concatenate([modes.frequency_hz, modes.damping_ratio])

    h = 1e-5
    J = np.stack(
        [(values(theta + h * e) - values(theta - h * e)) / (2 * h) for e in np.eye(theta.size)], axis=1
    )
    expected = np.sqrt(np.diag(J @ covariance @ J.T))
    modes = modes_with_std(family.tangent(theta, inputs, outputs), covariance)
    # Differences over steps of 1e-5: truncation 1e-10, rounding 1e-11.
    np.testing.assert_allclose(np.concatenate([modes.frequency_std, modes.damping_std]), expected, rtol=1e-7)
