"""Fisher information and the Cramér-Rao bound: by formula, by differences, and how they scale."""

from dataclasses import replace

import numpy as np
import pytest

from identification.errors import IdentificationError
from identification.information import cramer_rao_bound, fisher_information, planned, predict
from identification.parameterizations import Custom
from identification.recording import Channel
from identification.spring_network import WORLD, spring_network
from identification.structures import free_matrices
from identification.systems import SecondOrder, StateSpace
from tests import systems
from tests.systems import actuators, sensors

TRUTH = systems.chain3("coupled")
SYSTEM = systems.paper_chain3("coupled")
PULSES = systems.pulse_recording(SYSTEM, 1200)
RANDOM = planned(
    [np.random.default_rng(0).standard_normal((2, 300))],
    SYSTEM.inputs,
    SYSTEM.outputs,
    sample_rate=20.0,
    kind="random",
)


def percent_of_rms(recording, level):
    return level * np.stack([np.sqrt(np.mean(record.outputs**2, axis=1)) for record in recording.records])


def test_pure_gain_by_formula():
    u = np.random.default_rng(1).standard_normal((1, 100))
    channels = (Channel("u", "N"),), (Channel("y", "N"),)
    gain = Custom(
        ("g",),
        lambda g: StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [g], 0.0, *channels),
    )
    test = planned([u], *channels, sample_rate=1.0)
    information = fisher_information(np.array([2.0]), test, noise_std=0.1, parameterization=gain)
    # Derivatives by differences are good to ten digits.
    np.testing.assert_allclose(information, [[np.sum(u**2) / 0.1**2]], rtol=1e-10)


def test_decay_rate_of_a_released_first_order_system():
    # y = x0 e^{-a t}: derivatives -t x0 e^{-at} and e^{-at}; the unknown x0 is eliminated.
    a, x0, dt, n = 0.7, 3.0, 0.1, 80
    output = (Channel("y", "m"),)
    family = Custom(
        ("a",), lambda x: StateSpace([[-x[0]]], np.zeros((1, 0)), [[1.0]], np.zeros((1, 0)), 0.0, (), output)
    )
    test = planned([np.zeros((0, n))], (), output, sample_rate=1 / dt, kind="free_decay")
    t = dt * np.arange(n)
    J = np.stack([-t * x0 * np.exp(-a * t), np.exp(-a * t)])
    H = J @ J.T / 0.01**2
    found = fisher_information(
        np.array([a]), test, noise_std=0.01, parameterization=family, initial_states=[np.array([x0])]
    )
    np.testing.assert_allclose(found, [[H[0, 0] - H[0, 1] ** 2 / H[1, 1]]], rtol=1e-10)


def test_experiment_of_the_paper_equals_differences():
    noise = percent_of_rms(PULSES, 0.05)
    bound = cramer_rao_bound(TRUTH, PULSES, noise_std=noise)
    upper = np.triu_indices(3)

    def outputs(theta):
        matrices = []
        for part in theta.reshape(3, 6):
            X = np.zeros((3, 3))
            X[upper] = part
            matrices.append(X + X.T - np.diag(np.diag(X)))
        structure = SecondOrder(*matrices, TRUTH.dofs)
        system = systems.instrumented(structure, SYSTEM.outputs, SYSTEM.inputs).sampled(0.05)
        return (
            np.stack([r.outputs for r in systems.pulse_recording(system, 1200).records]) / noise[:, :, None]
        )

    theta = bound.values
    J = np.stack([(outputs(theta + h) - outputs(theta - h)).ravel() / 2e-4 for h in 1e-4 * np.eye(18)])
    expected = np.sqrt(np.diag(np.linalg.inv(J @ J.T)))
    # Differences over steps of 1e-4 of parameters of order one: truncation 1e-8, times a condition number of 1e3.
    np.testing.assert_allclose(bound.std, expected, rtol=1e-4)
    found = bound.second_order
    variation = [
        found.mass_std[0, 0] / 0.8, found.mass_std[1, 1] / 2.0, found.damping_std[0, 0] / 0.5, found.damping_std[2, 2] / 0.6
    ]  # fmt: skip
    # The figures known for this experiment: 2.17, 0.14, 1.98 and 0.54 %.
    np.testing.assert_allclose(variation, [0.0217, 0.0014, 0.0198, 0.0054], atol=5e-5)


def test_bound_follows_noise_and_number_of_tests():
    one = cramer_rao_bound(TRUTH, RANDOM, noise_std=0.1)
    louder = cramer_rao_bound(TRUTH, RANDOM, noise_std=[0.3, 0.3])
    four = cramer_rao_bound(TRUTH, replace(RANDOM, records=RANDOM.records * 4), noise_std=0.1)
    np.testing.assert_allclose(louder.std, 3 * one.std, rtol=1e-10)
    np.testing.assert_allclose(four.std, one.std / 2, rtol=1e-10)
    np.testing.assert_allclose(four.modes.damping_std, one.modes.damping_std / 2, rtol=1e-10)


def test_bound_follows_units_and_names():
    # Newtons to kilonewtons and metres to millimetres: the same structure in other numbers.
    inputs = tuple(replace(channel, factor=1000 * channel.factor) for channel in SYSTEM.inputs)
    outputs = tuple(replace(channel, factor=channel.factor / 1000) for channel in SYSTEM.outputs)
    u = RANDOM.records[0].inputs / 1000
    other = planned([u[::-1]], inputs[::-1], outputs[::-1], sample_rate=20.0)
    a = cramer_rao_bound(TRUTH, RANDOM, noise_std=[0.1, 0.2])
    b = cramer_rao_bound(TRUTH, other, noise_std=[2e-4, 1e-4])
    np.testing.assert_allclose(a.std, b.std, rtol=1e-9)


def test_modes_have_one_bound_however_they_are_parameterized():
    # Of all 28 parameters of a state space the 18 of a structure are a subset: knowing more scatters less.
    structure = cramer_rao_bound(TRUTH, RANDOM, noise_std=0.1).modes
    free = cramer_rao_bound(SYSTEM, RANDOM, noise_std=0.1).modes
    continuous = cramer_rao_bound(SYSTEM.continuous(), RANDOM, noise_std=0.1).modes
    assert np.all(structure.frequency_std < free.frequency_std * (1 + 1e-9))
    assert np.all(structure.damping_std < free.damping_std * (1 + 1e-9))
    # Sampled or continuous parameters are functions of each other. Rounding of a logarithm, times condition.
    np.testing.assert_allclose(free.frequency_std, continuous.frequency_std, rtol=1e-6)
    np.testing.assert_allclose(free.damping_std, continuous.damping_std, rtol=1e-6)


def test_unknown_start_costs_information():
    rest = fisher_information(TRUTH, RANDOM, noise_std=0.1)
    free = fisher_information(
        TRUTH, RANDOM, noise_std=0.1, initial_state="free", initial_states=[np.zeros(6)]
    )
    scale = np.sqrt(np.diag(rest))
    lost = np.linalg.eigvalsh((rest - free) / scale / scale[:, None])
    assert lost[0] > -1e-9
    # Six states can hide six directions, no more.
    assert np.sum(lost > 1e-9) <= 6
    assert lost[-1] > 1e-3


def test_parallel_springs_are_known_by_their_sum_only():
    network = spring_network(("x1",), [(WORLD, "x1"), (WORLD, "x1")], dashpots=[(WORLD, "x1")])
    u = np.random.default_rng(3).standard_normal((1, 200))
    test = planned([u], actuators(("x1",)), sensors(("x1",)), sample_rate=10.0)
    bound = cramer_rao_bound(np.array([1.0, 0.2, 3.0, 6.0]), test, noise_std=0.1, parameterization=network)
    assert np.isfinite(bound.std).tolist() == [True, True, False, False]
    single = spring_network(("x1",), [(WORLD, "x1")])
    alone = cramer_rao_bound(np.array([1.0, 0.2, 9.0]), test, noise_std=0.1, parameterization=single)
    np.testing.assert_allclose(bound.second_order.stiffness_std, alone.second_order.stiffness_std, rtol=1e-9)
    np.testing.assert_allclose(bound.modes.frequency_std, alone.modes.frequency_std, rtol=1e-9)
    assert "1 combinations not identifiable" in repr(bound)


def test_degree_of_freedom_without_sensor_or_actuator_is_not_identifiable():
    # Forces and sensor on x2 alone: x1 and x3 may be scaled at will.
    test = planned(
        [np.random.default_rng(4).standard_normal((1, 400))],
        actuators(("x2",)),
        sensors(("x2",)),
        sample_rate=20.0,
    )
    bound = cramer_rao_bound(TRUTH, test, noise_std=0.1)
    assert bound.blind.shape[1] > 0
    assert np.isinf(bound.second_order.mass_std[0, 0])
    assert np.all(np.isfinite(bound.modes.frequency_std))
    # With sensors on x2 and x3 and forces on x1 and x2 everything is.
    assert np.all(np.isfinite(cramer_rao_bound(TRUTH, RANDOM, noise_std=0.1).std))


def test_mass_on_free_ground_has_a_bound():
    # A free body has no modes to work with: mass from a known force and its acceleration.
    body = SecondOrder([[2.0]], [[0.0]], [[0.0]], ("x",))
    u = np.random.default_rng(5).standard_normal((1, 100))
    network = spring_network(("x",), [], dashpots=[])
    test = planned([u], actuators(("x",)), sensors(("x",)), sample_rate=10.0)
    bound = cramer_rao_bound(body, test, noise_std=0.1, parameterization=network)
    # a = u / m: derivative -u / m².
    np.testing.assert_allclose(bound.std, 0.1 * 4.0 / np.linalg.norm(u), rtol=1e-10)


def test_predictions_are_the_plain_simulation():
    found = predict(TRUTH, PULSES)
    for a, b in zip(found.records, PULSES.records, strict=True):
        np.testing.assert_allclose(a.outputs, b.outputs, atol=1e-14)
    x0 = np.arange(1.0, 7)
    moving = predict(SYSTEM, RANDOM, initial_states=None).records[0].outputs
    np.testing.assert_allclose(moving, SYSTEM.simulate(RANDOM.records[0].inputs), atol=1e-12)
    continuous = systems.instrumented(TRUTH, SYSTEM.outputs, SYSTEM.inputs)
    released = predict(TRUTH, RANDOM, initial_states=[x0]).records[0].outputs
    np.testing.assert_allclose(
        released, continuous.sampled(0.05).simulate(RANDOM.records[0].inputs, x0), atol=1e-12
    )


def test_experiments_that_make_no_sense():
    with pytest.raises(
        IdentificationError, match=r"noise_std is 0.0; expected positive numbers, one, 2 or 1 x 2"
    ):
        cramer_rao_bound(TRUTH, RANDOM, noise_std=0.0)
    with pytest.raises(IdentificationError, match="noise_std is"):
        cramer_rao_bound(TRUTH, RANDOM, noise_std=[0.1, 0.1, 0.1])
    with pytest.raises(
        IdentificationError, match=r"initial_states are 0 of shapes .*; expected 1 of 6 states"
    ):
        cramer_rao_bound(TRUTH, RANDOM, noise_std=0.1, initial_state="free")
    with pytest.raises(IdentificationError, match="Modes does not say how all inputs take part"):
        cramer_rao_bound(SYSTEM.modes(), RANDOM, noise_std=0.1)
    with pytest.raises(IdentificationError, match="the model is ndarray; expected SecondOrder"):
        cramer_rao_bound(np.zeros(3), RANDOM, noise_std=0.1)


def test_planned_tests_may_use_any_parameterization():
    by_theta = cramer_rao_bound(
        free_matrices(TRUTH.dofs).start(TRUTH),
        RANDOM,
        noise_std=0.1,
        parameterization=free_matrices(TRUTH.dofs),
    )
    np.testing.assert_array_equal(by_theta.std, cramer_rao_bound(TRUTH, RANDOM, noise_std=0.1).std)
