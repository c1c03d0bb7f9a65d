"""The search for the maximum, on problems whose maximum is known."""

import numpy as np
import pytest

from identification.errors import IdentificationError
from identification.output_error import output_error
from identification.parameterizations import Custom
from identification.recording import Channel, Record, Recording
from identification.scoring import Curvature, Noise, maximize, noise_model, solve_linear
from identification.systems import StateSpace

U, Y = (Channel("u", "N"),), (Channel("y0", "N"), Channel("y1", "N"))


def gains(function):
    """y_i = g_i(θ) u: the simplest model there is."""
    return lambda theta: StateSpace(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((2, 0)), np.reshape(function(theta), (2, 1)), 0.0, U, Y
    )


def recording_of(g, noise, rng, n_samples=400):
    u = rng.standard_normal((1, n_samples))
    y = np.reshape(g, (2, 1)) * u + np.reshape(noise, (2, 1)) * rng.standard_normal((2, n_samples))
    return Recording((Record("random", u, y),), U, Y, 1.0)


def fit(recording, family, start, **options):
    start = np.asarray(start, dtype=float)
    problem = output_error(recording, family, start)
    return problem, maximize(problem, noise_model(problem, per_record=True), start, **options)


def test_linear_gains_are_least_squares():
    recording = recording_of([2.0, -3.0], [0.1, 1.0], np.random.default_rng(0))
    family = Custom(("a", "b"), gains(lambda x: x))
    _, found = fit(recording, family, [0.0, 0.0])
    u, y = recording.records[0].inputs[0], recording.records[0].outputs
    np.testing.assert_allclose(found.q, y @ u / (u @ u), rtol=1e-9)
    variance = np.mean((y - np.outer(found.q, u)) ** 2, axis=1)
    np.testing.assert_allclose(np.diag(found.information), u @ u / variance, rtol=1e-8)
    assert found.converged
    assert found.distance < 1e-4


def test_a_common_gain_weighs_outputs_by_their_noise():
    # Both outputs read the same gain; the likelihood's own weights satisfy w_i = N / Σ (y_i - g u)².
    recording = recording_of([2.0, 2.0], [0.1, 2.0], np.random.default_rng(1))
    _, found = fit(recording, Custom(("g",), gains(lambda x: [x[0], x[0]])), [1.0])
    u, y = recording.records[0].inputs[0], recording.records[0].outputs
    g = found.q[0]
    w = 1 / np.mean((y - g * u) ** 2, axis=1)
    # 1e-4 standard deviations, of 0.1 / sqrt(400) each, is where the search stops.
    assert g == pytest.approx(np.sum(w @ y * u) / (w.sum() * (u @ u)), abs=1e-6)


@pytest.mark.parametrize("start", [3.0, -1.0, 0.3])
def test_steps_too_long_are_shortened(start):
    # From -1 a Gauss-Newton step of atan overshoots ever further; damping must hold it.
    recording = recording_of(np.arctan([2.0, 2.0]), [0.01, 0.01], np.random.default_rng(2))
    _, found = fit(recording, Custom(("x",), gains(lambda x: np.arctan([x[0], x[0]]))), [start])
    assert found.converged
    assert found.q[0] == pytest.approx(
        2.0, abs=0.02
    )  # five of its standard deviations 0.01 · 5 / sqrt(800) · 2


def test_unidentifiable_directions_stay_where_they_are():
    recording = recording_of([3.0, 3.0], [0.1, 0.1], np.random.default_rng(3))
    family = Custom(("a", "b"), gains(lambda x: [x[0] + x[1]] * 2))
    problem, found = fit(recording, family, [0.0, 1.0])
    assert found.q[1] - found.q[0] == pytest.approx(1.0, abs=1e-9)
    assert found.q.sum() == pytest.approx(3.0, abs=0.05)
    assert Curvature.of(found.information).seen.tolist() == [False, True]
    fixed = solve_linear(problem, np.array([0.0, 1.0]), np.array([True, False]))
    np.testing.assert_allclose(
        fixed, [found.q.sum() - 1, 1], atol=1e-2
    )  # the mean of both outputs, unweighted


def test_giving_up_says_how_far_it_is():
    recording = recording_of([2.0, 2.0], [0.1, 0.1], np.random.default_rng(4))
    _, found = fit(recording, Custom(("x",), gains(lambda x: [x[0] ** 3] * 2)), [0.5], max_iterations=1)
    assert not found.converged
    assert found.n_iterations == 1
    assert found.distance > 1


def test_exact_data_are_fitted_to_rounding():
    recording = recording_of([8.0, 8.0], [0.0, 0.0], np.random.default_rng(5))
    _, found = fit(recording, Custom(("x",), gains(lambda x: [x[0] ** 3] * 2)), [0.5])
    assert found.converged
    assert found.q[0] == pytest.approx(2.0, rel=1e-13)


def test_curvature_solves_scaled_equations():
    rng = np.random.default_rng(6)
    X = rng.standard_normal((20, 4)) * [1, 1e6, 1e-6, 1]
    H, g = X.T @ X, rng.standard_normal(4)
    curvature = Curvature.of(H)
    exact = (
        np.linalg.solve(H / np.outer(curvature.scale, curvature.scale), g / curvature.scale) / curvature.scale
    )
    np.testing.assert_allclose(curvature.solve(g), exact, rtol=1e-10)
    damped = np.linalg.solve(H + 0.1 * np.diag(np.diag(H)), g)
    np.testing.assert_allclose(
        curvature.solve(g, 0.1), damped, rtol=1e-6
    )  # the plain solve suffers from the scales


def test_noise_is_pooled_over_records_or_not():
    n, squares = np.array([[100.0], [300.0]]), np.array([[1.0, 4.0], [9.0, 4.0]])
    own = Noise(n, np.zeros((2, 2)), per_record=True)
    shared = Noise(n, np.zeros((2, 2)), per_record=False)
    np.testing.assert_allclose(own.variance(squares), [[0.01, 0.04], [0.03, 4 / 300]])
    np.testing.assert_allclose(shared.variance(squares), [[0.025, 0.02]] * 2)
    assert own.cost(squares) == pytest.approx(0.5 * np.sum(n * np.log(squares / n)))
    assert own.cost(np.full((2, 2), np.inf)) == np.inf


def test_silent_recordings_are_refused():
    recording = recording_of([0.0, 0.0], [0.0, 0.0], np.random.default_rng(7))
    with pytest.raises(IdentificationError, match="all outputs are zero"):
        fit(recording, Custom(("a", "b"), gains(lambda x: x)), [1.0, 1.0])
