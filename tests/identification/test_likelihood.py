"""Maximum likelihood: exact from exact data, on the bound from noisy data, and honest about both."""

from dataclasses import replace

import numpy as np
import pytest

from identification.era import era
from identification.errors import IdentificationError, NotSecondOrderError, RecordingError, TooShortError
from identification.information import cramer_rao_bound
from identification.likelihood import refine
from identification.parameterizations import Custom
from identification.pulse import markov_parameters
from identification.recording import Channel, Recording
from identification.spring_network import WORLD, spring_network
from identification.structures import Structure, free_matrices
from identification.systems import SecondOrder, StateSpace
from tests import systems
from tests.systems import actuators, instrumented, sensors, with_noise

TRUTH = systems.chain3("coupled")
SYSTEM = systems.paper_chain3("coupled")
NETWORK = spring_network(
    TRUTH.dofs, [("x1", "x2"), ("x1", "x3"), ("x2", "x3"), (WORLD, "x1"), (WORLD, "x2"), (WORLD, "x3")]
)
ELEMENTS = np.array([0.8, 2.0, 1.2, 0.1, 0.2, 0.3, 0.2, 0.3, 0.1, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


def random_recording(n_samples=400, n_records=1, seed=0):
    rng = np.random.default_rng(seed)
    return systems.recorded(SYSTEM, [rng.standard_normal((2, n_samples)) for _ in range(n_records)])


def moved(structure, share, seed=0):
    """Every entry off by a share of the diagonal, symmetric."""
    rng = np.random.default_rng(seed)
    matrices = []
    for X in (structure.mass, structure.damping, structure.stiffness):
        E = rng.uniform(-share, share, X.shape) * np.sqrt(np.outer(np.diag(X), np.diag(X)))
        matrices.append(X + (E + E.T) / 2)
    return SecondOrder(*matrices, structure.dofs)


def worst(found, truth=TRUTH):
    return max(
        np.abs(getattr(found, name) - getattr(truth, name)).max() / np.abs(getattr(truth, name)).max()
        for name in ("mass", "damping", "stiffness")
    )


# --- Missing samples


def with_gaps(recording, seed=0):
    """A fifth of all samples of the outputs missing, one by one, and half of the last output at a stretch."""
    rng, records = np.random.default_rng(seed), []
    for record in recording.records:
        y = np.where(rng.random(record.outputs.shape) < 0.2, np.nan, record.outputs)
        y[-1, : record.n_samples // 2] = np.nan
        records.append(replace(record, outputs=y))
    return replace(recording, records=tuple(records))


def test_exact_data_with_gaps_give_the_exact_structure():
    found = refine(
        with_gaps(random_recording()), moved(TRUTH, 0.02), parameterization=free_matrices(TRUTH.dofs)
    )
    assert found.converged
    assert worst(found.second_order) < 1e-8  # as without gaps


def test_gaps_widen_the_error_bars_to_the_bound_and_no_further():
    level, clean = 0.05, random_recording(n_samples=800)
    recording = with_gaps(with_noise(clean, level, seed=1))
    found = refine(recording, TRUTH, parameterization=free_matrices(TRUTH.dofs))
    std = level * np.sqrt(np.mean(np.square(clean.records[0].outputs), axis=1))
    whole, bound = (cramer_rao_bound(TRUTH, each, noise_std=std) for each in (clean, recording))
    # 640 and 320 samples know the noise to 4 %, and the bound moves with the estimate by some per cent.
    np.testing.assert_allclose(found.noise_std[0], std, rtol=0.12)
    upper = np.triu_indices(3)
    for name in ("mass", "damping", "stiffness"):
        own, least, complete = (
            getattr(each.second_order, f"{name}_std")[upper] for each in (found, bound, whole)
        )
        np.testing.assert_allclose(own, least, rtol=0.2)
        assert np.all(least > 1.05 * complete)  # a fifth of all samples alone makes 1 / √0.8 = 1.12
        error = (getattr(found.second_order, name) - getattr(TRUTH, name))[upper]
        assert np.all(np.abs(error) < 4.5 * own)  # one test of 15 000 has an entry beyond
    assert np.all(found.whiteness > 1e-3)


# --- Exact data


@pytest.mark.parametrize("kind", ["random", "pulse", "two records", "in motion"])
def test_matrices_from_exact_data(kind):
    recording = {
        "random": random_recording(),
        "pulse": systems.pulse_recording(SYSTEM, 400),
        "two records": random_recording(200, 2),
        "in motion": systems.recorded(
            instrumented(TRUTH, SYSTEM.outputs, SYSTEM.inputs).sampled(0.05),
            [np.random.default_rng(0).standard_normal((2, 400))],
            initial=[np.arange(1.0, 7)],
        ),
    }[kind]
    estimate = refine(recording, moved(TRUTH, 0.1), initial_state="free" if kind == "in motion" else "auto")
    assert estimate.converged
    # The search stops 1e-4 standard deviations from the maximum, of noise taken as 1e-10 of the signal at least.
    assert worst(estimate.second_order) < 1e-11
    power = [np.mean(record.outputs**2, axis=1) for record in recording.records]
    assert np.all(estimate.noise_std < 2e-10 * np.sqrt(power))
    if kind == "in motion":
        np.testing.assert_allclose(estimate.initial_states[0], np.arange(1.0, 7), rtol=1e-10)


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_every_kind_of_motion(quantity):
    system = instrumented(TRUTH, sensors(("x2", "x3"), quantity, factor=-2.0), SYSTEM.inputs).sampled(0.05)
    recording = systems.recorded(system, [np.random.default_rng(1).standard_normal((2, 400))])
    assert worst(refine(recording, moved(TRUTH, 0.05)).second_order) < 1e-10


def test_springs_of_a_known_network():
    estimate = refine(random_recording(), moved(TRUTH, 0.1), parameterization=NETWORK)
    np.testing.assert_allclose(estimate.values, ELEMENTS, rtol=1e-10)
    again = refine(random_recording(), 1.2 * ELEMENTS, parameterization=NETWORK)
    np.testing.assert_allclose(again.values, ELEMENTS, rtol=1e-10)


def test_free_decays_without_inputs():
    system = systems.chain7()
    outputs = sensors(("x3", "x7"))
    continuous = instrumented(system, outputs, ())
    sampled = continuous.sampled(0.01)
    starts = [np.eye(14)[i] for i in (0, 6)]
    recording = systems.recorded(sampled, [np.zeros((0, 300))] * 2, kind="free_decay", initial=starts)
    realized = era(markov_parameters(recording), 14)
    assert realized.system.inputs[0].name == "release1"  # pseudo-inputs that the recording does not have
    estimate = refine(with_noise(recording, 1e-6, seed=0), realized)
    truth = continuous.modes()
    assert estimate.converged
    assert len(estimate.initial_states) == 2
    error = estimate.modes.frequency_hz - truth.frequency_hz
    # Within five of its own standard deviations, which are tiny themselves.
    assert np.all(np.abs(error) < 5 * estimate.modes.frequency_std)
    assert np.all(estimate.modes.frequency_std < 1e-4 * truth.frequency_hz)


def test_modes_gain_participation():
    recording = random_recording()
    truth = SYSTEM.modes()
    start = replace(truth, frequency_hz=1.01 * truth.frequency_hz, damping_ratio=0.8 * truth.damping_ratio)
    estimate = refine(recording, start)
    np.testing.assert_allclose(estimate.modes.poles, truth.poles, rtol=1e-9)
    f = np.linspace(0.05, 1, 20)
    H = SYSTEM.frequency_response(f)
    np.testing.assert_allclose(estimate.system.frequency_response(f), H, atol=1e-9 * np.abs(H).max())
    assert estimate.second_order is None


def test_parameters_of_a_function():
    free = free_matrices(TRUTH.dofs)
    theta = free.start(TRUTH)

    def matrices(x):
        """One factor on all damping, one on all stiffness."""
        factors = np.repeat([1.0, x[0], x[1]], 6)
        tangent = free.matrices(factors * theta)
        zero = np.zeros((3, 3))
        return replace(
            tangent,
            M_theta=np.stack([zero, zero]),
            C_theta=np.stack([TRUTH.damping, zero]),
            K_theta=np.stack([zero, TRUTH.stiffness]),
        )

    family = Structure(("damping", "stiffness"), matrices)
    estimate = refine(random_recording(), np.array([0.5, 1.25]), parameterization=family)
    np.testing.assert_allclose(estimate.values, 1, rtol=1e-11)
    by_differences = Custom(
        family.names, lambda x: instrumented(matrices(x).structure, SYSTEM.outputs, SYSTEM.inputs)
    )
    again = refine(random_recording(), np.array([0.5, 1.25]), parameterization=by_differences)
    np.testing.assert_allclose(again.values, 1, rtol=1e-10)
    assert again.second_order is None


def test_free_body_without_springs():
    body = SecondOrder(np.diag([2.0, 3.0]), np.zeros((2, 2)), np.array([[5.0, -5], [-5, 5]]), ("a", "b"))
    inputs, outputs = actuators(("a",)), sensors(("a", "b"))
    system = instrumented(body, outputs, inputs).sampled(0.1)
    recording = systems.recorded(system, [np.random.default_rng(2).standard_normal((1, 300))])
    family = spring_network(("a", "b"), [("a", "b")])
    estimate = refine(recording, np.array([2.2, 2.8, 0.05, 5.2]), parameterization=family)
    np.testing.assert_allclose(estimate.values, [2, 3, 0, 5], atol=1e-10)
    assert len(estimate.modes) == 1  # the rigid body does not oscillate


# --- Noisy data


def test_estimate_does_not_depend_on_the_start():
    recording = with_noise(systems.pulse_recording(SYSTEM, 600), 0.05, seed=1)
    starts = [TRUTH, moved(TRUTH, 0.2, seed=2), era(markov_parameters(recording), 6, n_rows=60, n_columns=60)]
    estimates = [refine(recording, start, parameterization=free_matrices(TRUTH.dofs)) for start in starts]
    for estimate in estimates:
        assert estimate.converged
        # Two searches that stop within 1e-4 standard deviations each.
        distance = (estimate.values - estimates[0].values) / estimates[0].std
        assert np.max(np.abs(distance)) < 5e-4


def test_unstable_start_is_calmed_and_told():
    recording = with_noise(systems.pulse_recording(SYSTEM, 1200), 0.05, seed=1)
    start = replace(TRUTH, damping=TRUTH.damping - 0.5 * np.eye(3))
    assert np.any(start.modes().damping_ratio < 0)
    estimate = refine(recording, start)
    assert estimate.converged
    assert "The start was unstable" in estimate.notes[0]
    # Two searches that stop within 1e-4 standard deviations each.
    assert np.max(np.abs(estimate.values - refine(recording, TRUTH).values) / estimate.std) < 5e-4


def test_likelihood_rises_and_noise_is_measured():
    n = 2000
    recording = with_noise(random_recording(n), 0.1, seed=3)
    estimate = refine(recording, TRUTH)
    sigma = 0.1 * np.sqrt(np.mean(random_recording(n).records[0].outputs ** 2, axis=1))
    # A standard deviation from 2000 samples is good to 1 / sqrt(4000).
    np.testing.assert_allclose(estimate.noise_std[0], sigma, rtol=4 / np.sqrt(2 * n))
    e = recording.records[0].outputs - random_recording(n).records[0].outputs
    at_truth = -0.5 * n * np.sum(np.log(2 * np.pi * np.mean(e**2, axis=1)) + 1)
    # Twice the gain is chi-squared with 18 degrees of freedom: between 4 and 50 in all but one seed in 10 000.
    assert 2 < estimate.log_likelihood - at_truth < 25
    assert np.all(estimate.whiteness > 1e-3)
    assert estimate.notes == ()


def test_pooled_noise_is_shared():
    recording = with_noise(random_recording(300, 3), 0.1, seed=4)
    pooled = refine(recording, TRUTH, noise_per_record=False)
    own = refine(recording, TRUTH)
    assert np.ptp(pooled.noise_std, axis=0).max() == 0
    assert np.ptp(own.noise_std, axis=0).min() > 0
    assert np.max(np.abs(pooled.values - own.values) / own.std) < 1


def test_estimate_follows_a_permutation_of_channels_and_units():
    recording = with_noise(random_recording(), 0.05, seed=5)
    names = [channel.name for channel in recording.outputs[::-1]]
    turned = recording.select(outputs=names)
    factors = (0.001, 1000.0)
    scaled = replace(
        turned,
        outputs=tuple(replace(c, factor=f) for c, f in zip(turned.outputs, factors, strict=True)),
        records=tuple(replace(r, outputs=r.outputs * np.reshape(factors, (2, 1))) for r in turned.records),
    )
    a, b = refine(recording, TRUTH), refine(scaled, TRUTH)
    assert np.max(np.abs(a.values - b.values) / a.std) < 5e-4
    np.testing.assert_allclose(a.std, b.std, rtol=1e-5)


def test_coloured_noise_is_told():
    recording = random_recording(1000)
    e = np.random.default_rng(6).standard_normal((2, 1001))
    outputs = recording.records[0].outputs + 0.02 * (e[:, 1:] + e[:, :-1])
    estimate = refine(replace(recording, records=(replace(recording.records[0], outputs=outputs),)), TRUTH)
    assert np.all(
        estimate.whiteness < 1e-6
    )  # correlation of a half over 1000 samples: sixteen standard deviations
    assert "is not white" in estimate.notes[-1]


def test_what_the_data_do_not_determine_is_named():
    network = spring_network(("x",), [(WORLD, "x"), {"x": 1.0}], masses={"x": 1.0}, dashpots=[(WORLD, "x")])
    system = instrumented(
        SecondOrder([[1]], [[0.2]], [[9]], ("x",)), sensors(("x",)), actuators(("x",))
    ).sampled(0.1)
    recording = systems.recorded(system, [np.random.default_rng(7).standard_normal((1, 300))])
    estimate = refine(with_noise(recording, 0.05, 0), np.array([0.3, 3.0, 5.0]), parameterization=network)
    assert estimate.converged
    assert np.isinf(estimate.std).tolist() == [False, True, True]
    assert estimate.second_order.stiffness[0, 0] == pytest.approx(
        9, abs=5 * estimate.second_order.stiffness_std[0, 0]
    )
    assert np.isfinite(estimate.second_order.stiffness_std[0, 0])
    assert "do not determine k(world|x), k(x) one by one" in estimate.notes[-1]


def test_stopping_early_is_told():
    estimate = refine(with_noise(random_recording(), 0.05, 8), moved(TRUTH, 0.1), max_iterations=1)
    assert not estimate.converged
    assert "stopped after 1 steps" in estimate.notes[0]
    assert "not converged in 1 steps" in repr(estimate)


def scatter(recording, start, level, n_patterns, parameterization):
    estimates = [
        refine(noisy_one, start(noisy_one), parameterization=parameterization)
        for noisy_one in (with_noise(recording, level, seed) for seed in range(n_patterns))
    ]
    assert all(estimate.converged for estimate in estimates)
    return estimates


@pytest.mark.slow
@pytest.mark.parametrize("level", [0.01, 0.05, 0.2])
def test_pulses_of_the_paper_are_on_the_bound(level):
    recording = systems.pulse_recording(SYSTEM, 1200)
    noise = level * np.stack([np.sqrt(np.mean(r.outputs**2, axis=1)) for r in recording.records])
    bound = cramer_rao_bound(TRUTH, recording, noise_std=noise)

    def start(noisy_one):
        return era(markov_parameters(noisy_one), 6, n_rows=60, n_columns=60)

    n = 100
    estimates = scatter(recording, start, level, n, free_matrices(TRUTH.dofs))
    errors = np.stack([estimate.values for estimate in estimates]) - bound.values
    # Mahalanobis distances are chi-squared with 18 degrees of freedom: mean 18, to four standard deviations.
    distance = np.einsum("np,pq,nq->n", errors, np.linalg.inv(bound.covariance), errors)
    assert abs(distance.mean() / 18 - 1) < 4 * np.sqrt(2 / 18 / n) + level**2
    own = np.mean(
        [
            (e.values - bound.values) @ np.linalg.solve(e.covariance, e.values - bound.values)
            for e in estimates
        ]
    )
    assert abs(own / 18 - 1) < 4 * np.sqrt(2 / 18 / n) + level
    # Each entry and each mode: a standard deviation from 100 patterns is good to 7 %; 25 % is 3.5 of them.
    reported = np.sqrt(np.mean([e.std**2 for e in estimates], axis=0))
    np.testing.assert_allclose(reported / np.std(errors, axis=0, ddof=1), 1, atol=0.25)
    for name in ("frequency", "damping"):
        field = "frequency_hz" if name == "frequency" else "damping_ratio"
        values = np.stack([getattr(e.modes, field) for e in estimates])
        stds = np.sqrt(np.mean([getattr(e.modes, f"{name}_std") ** 2 for e in estimates], axis=0))
        np.testing.assert_allclose(stds / np.std(values, axis=0, ddof=1), 1, atol=0.25)


def test_modes_are_on_the_bound_whatever_the_structure():
    recording = random_recording(600)
    noise = 0.1 * np.sqrt(np.mean(recording.records[0].outputs ** 2, axis=1))
    bound = cramer_rao_bound(SYSTEM, recording, noise_std=noise).modes
    n = 12
    estimates = scatter(recording, lambda _: SYSTEM, 0.1, n, None)
    truth = SYSTEM.modes()
    f = np.stack([(e.modes.frequency_hz - truth.frequency_hz) / bound.frequency_std for e in estimates])
    z = np.stack([(e.modes.damping_ratio - truth.damping_ratio) / bound.damping_std for e in estimates])
    # 72 squares of nearly independent normal numbers: their mean is one to 17 %, here four times that.
    assert abs(np.mean([f**2, z**2]) - 1) < 0.68


# --- What cannot be refined


def test_inputs_at_fault():
    recording = random_recording()
    with pytest.raises(IdentificationError, match="the model is str; expected SecondOrder, StateSpace"):
        refine(recording, "chain3")
    with pytest.raises(NotSecondOrderError, match="channel 'force_x1' has dof ''"):
        refine(replace(recording, inputs=tuple(replace(c, dof="") for c in recording.inputs)), TRUTH)
    with pytest.raises(TooShortError, match="16 samples cannot determine 18 unknowns"):
        refine(recording.cut(0, 0.4), TRUTH)
    ambient = replace(
        recording,
        records=tuple(replace(r, kind="ambient", inputs=np.zeros((0, 400))) for r in recording.records),
    )
    with pytest.raises(RecordingError, match="has no measured inputs"):
        refine(ambient, TRUTH)
    with pytest.raises(IdentificationError, match=r"no state space .*singular"):
        refine(recording, replace(TRUTH, mass=np.zeros((3, 3))))
    growing = Custom(
        ("a",),
        lambda a: StateSpace([a], [[1.0]], [[1.0]], [[0.0]], 0.0, (Channel("u", "N"),), (Channel("y", "m"),)),
    )
    short = Recording(random_one_channel(), (Channel("u", "N"),), (Channel("y", "m"),), 1.0)
    with pytest.raises(IdentificationError, match="start grows beyond all bounds"):
        refine(short, np.array([100.0]), parameterization=growing)


def random_one_channel():
    record = random_recording().records[0]
    return (replace(record, inputs=record.inputs[:1], outputs=record.outputs[:1]),)
