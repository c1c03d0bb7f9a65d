"""Responses where modes do not exist: rigid bodies and critical damping, against formulas and a plain loop."""

import numpy as np
import pytest

from identification import cascade
from identification.modal_signals import Run, spectrum
from identification.parameterizations import Tangent
from identification.systems import StateSpace
from tests.identification.test_modal_responses import (
    DT,
    assert_close,
    channels,
    expected_equations,
    oscillators,
    run_of,
    system_of,
    tangent_of,
)


def test_free_mass_under_a_held_force():
    mass, n = 2.0, 50
    system = StateSpace(
        [[0, 1], [0, 0]],
        [[0], [1 / mass]],
        [[1, 0], [0, 1]],
        np.zeros((2, 1)),
        0.0,
        channels(1, "u"),
        channels(2, "y"),
    )
    assert spectrum(system) is None
    run = Run(np.ones((1, n)), np.array([0]), np.zeros((2, n)), DT)
    t = DT * np.arange(n)
    x0, v0 = 0.3, -0.2
    expected = [x0 + v0 * t + t**2 / (2 * mass), v0 + t / mass]
    np.testing.assert_allclose(cascade.simulate(system, run, np.array([x0, v0])), expected, atol=1e-13)


def test_critically_damped_pulse_and_its_derivatives():
    # q̈ + 2 a q̇ + a² q = 0 from (0, 1): q = t e^{-at}; with the damping 2 a + d free, ∂q/∂d is a t³ e^{-at} / 6
    # short of its own t² e^{-at} / 2.
    a, n = 1.5, 80
    A = np.array([[0.0, 1.0], [-(a**2), -2 * a]])
    system = StateSpace(A, np.zeros((2, 0)), [[1.0, 0.0]], np.zeros((1, 0)), 0.0, (), channels(1, "y"))
    slope = Tangent(
        system, [[[0, 0], [0, -1]]], np.zeros((1, 2, 0)), np.zeros((1, 1, 2)), np.zeros((1, 1, 0))
    )
    t = DT * np.arange(n)
    q = t * np.exp(-a * t)
    dq = np.exp(-a * t) * (a * t**3 / 6 - t**2 / 2)
    run = Run(np.zeros((0, n)), np.zeros(0, dtype=int), q[None] + 1.0, DT)
    assert_close(cascade.simulate(system, run, np.array([0.0, 1.0]))[0], q, 1e-13)
    gradient, information = cascade.normal_equations(slope, run, np.array([0.0, 1.0]), np.array([2.0]))
    np.testing.assert_allclose(gradient[0], 2 * dq.sum(), rtol=1e-12)
    np.testing.assert_allclose(information[0, 0], 2 * dq @ dq, rtol=1e-12)


@pytest.mark.parametrize("dt", [0.0, DT], ids=["continuous", "sampled"])
@pytest.mark.parametrize("kind", ["rigid", "critical", "apart"])
def test_equations_equal_the_plain_loop(kind, dt):
    rng = np.random.default_rng(5)
    rigid, critical = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 1.0], [-4.0, -4.0]])
    A = np.zeros((4, 4))
    A[:2, :2] = {"rigid": rigid, "critical": critical, "apart": oscillators(-0.1 + 2j)}[kind]
    A[2:, 2:] = oscillators(-0.3 + 5j)
    if dt:
        A = np.eye(4) + DT * A
    tangent = tangent_of(system_of(A, 2, 2, rng, dt=dt), 3, rng)
    run, weights = run_of(tangent.system, 100, rng), np.array([1.0, 3.0])
    for x0 in (None, rng.standard_normal(4)):
        for ours, twin in zip(
            cascade.normal_equations(tangent, run, x0, weights),
            expected_equations(tangent, run, x0, weights),
            strict=True,
        ):
            assert_close(ours, twin, 1e-11)
