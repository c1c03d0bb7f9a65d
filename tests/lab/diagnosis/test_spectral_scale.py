"""Responses of unknown scale, models near one, errors that grow with the response, and what a baseline teaches of them."""

from dataclasses import replace

import numpy as np
import pytest

from lab.diagnosis.calibrate import parameters_of
from lab.diagnosis.outcome import EXPLAINED
from lab.diagnosis.spectral.changes import changes
from lab.diagnosis.spectral.diagnose import diagnose_spectra
from lab.diagnosis.spectral.fit import fit
from lab.diagnosis.spectral.lesson import LEVEL, lesson_of
from lab.diagnosis.spectral.nearby import Nearby, shares_of
from lab.diagnosis.spectral.neighbourhood import Stepwise
from lab.diagnosis.spectral.responses import Responses
from lab.diagnosis.spectral.scale import Scale
from lab.diagnosis.spectral.spread import noise_floors, spread_of
from lab.diagnosis.spectral.transfer import plant_response
from lab.effects import EFFECTS
from lab.rig import Rig
from lab.twin import twin
from tests.lab.diagnosis.test_spectral_diagnose import responses

FREQUENCY = np.linspace(0.1, 20.0, 50)


@pytest.fixture(scope="module")
def rig():
    return Rig.load("models/chain7.xml").connected(inputs=["force2"], outputs=["acc2.x", "acc5.x", "acc7.x"])


@pytest.fixture(scope="module")
def two_inputs():
    return Rig.load("models/chain7.xml").connected(inputs=["force1", "force3"], outputs=["acc1.x", "pos2"])


def likelihood_of(rig, data):
    return Responses.of(data, band=None).likelihood(twin(rig), parameters_of(twin(rig)), rig)


@pytest.mark.parametrize("share", [2, 9, 16])
def test_a_changed_share_gives_the_response_of_the_changed_plant(two_inputs, share):
    model = twin(two_inputs)
    late = replace(model, plant=model.plant.with_output(0, gain=1.3, delay=0.01).with_input(1, lag=0.02))
    late = replace(late, plant=replace(late.plant, order=(1, 0)))
    near = Nearby(late.plant, 2j * np.pi * FREQUENCY, shares_of(late))
    for factor, found in zip(
        (0.3, 1.0, 2.5), near.with_factors(share, np.array([0.3, 1.0, 2.5])), strict=True
    ):
        factors = np.ones(21)
        factors[share] = factor
        expected = plant_response(late.changed(*np.split(factors, 3)), FREQUENCY, dt=0.0)
        # Two exact ways: the rounding of an inversion with a condition of about 1e4.
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())


def test_slopes_are_those_of_differences(rig):
    likelihood = likelihood_of(rig, replace(responses(rig, 0.01, 1, 0.0), scale="unknown per response"))
    theta, nuisance = np.linspace(-1, 1, 21), np.linspace(-0.3, 0.3, 6)
    predicted = likelihood.predict(theta, (), nuisance)
    exact = np.array(likelihood.around(theta, (), nuisance).slopes(predicted))
    stepped = np.array(Stepwise(likelihood, theta, (), nuisance).slopes(predicted))
    # One-sided differences with a step of 1e-3 err by half of it times a curvature of order one; 2.7e-4 here.
    scale = np.abs(stepped).max(axis=(1, 2, 3))
    assert np.all(np.abs(exact - stepped).max(axis=(1, 2, 3)) < 1e-3 * scale)


@pytest.mark.parametrize("j", [0, 8, 15])
def test_trials_along_one_parameter_are_the_models_there(rig, j):
    likelihood = likelihood_of(rig, responses(rig, 0.01, 1, 0.0))
    theta, direction = np.linspace(-2, 2, 21), np.eye(21)[j]
    near = likelihood.around(theta, (), np.zeros(0))
    for trial in near.along(direction, np.array([0.4, 1.0, 2.2])):
        expected = likelihood.predict(trial.theta, (), np.zeros(0))
        # Two exact ways, as above.
        np.testing.assert_allclose(trial.predicted, expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())


def test_bodies_that_turn_and_slide_change_as_a_whole():
    rig = Rig.load("models/truss.xml")
    rig = rig.connected(inputs=[rig.inputs[0].name], outputs=[rig.outputs[0].name])
    model = twin(rig)
    near = Nearby(model.plant, 2j * np.pi * FREQUENCY, shares_of(model))
    factors = np.ones(len(model.bodies))
    factors[1] = 1.7
    springs = np.ones(len(model.springs))
    expected = plant_response(model.changed(factors, springs, springs), FREQUENCY, dt=0.0)
    (found,) = near.with_factors(1, np.array([1.7]))
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("word", ["unknown per input", "unknown per response"])
def test_least_squares_gives_the_factors_back(word):
    rng = np.random.default_rng(1)
    H = rng.standard_normal((40, 3, 2)) + 1j * rng.standard_normal((40, 3, 2))
    scale = Scale.of(word, 3, 2)
    factors = rng.standard_normal(scale.estimate.size) + 1j * rng.standard_normal(scale.estimate.size)
    values = replace(scale, estimate=factors).applied(H, np.zeros(scale.n))
    scale = scale.estimated(H, values)
    np.testing.assert_allclose(scale.estimate, factors, rtol=1e-12)
    nuisance = scale.fitted(2 * H, values, np.ones(H.shape))
    np.testing.assert_allclose(scale.applied(2 * H, nuisance), values, rtol=1e-12)


def test_a_known_scale_has_no_factor():
    H = np.ones((5, 2, 2), dtype=complex)
    scale = Scale.of("known", 2, 2)
    assert scale.n == 0
    np.testing.assert_array_equal(scale.applied(H, np.zeros(0)), H)


def test_an_added_mass_shows_in_responses_of_any_scale(rig):
    heavy = EFFECTS["mass_change"]("mass5", delta_mass=0.1).apply(rig)
    data = responses(heavy, 0.01, 5, 0.0)
    factors = np.array([3.0 - 1.0j, 0.02j, -50.0])[:, None]
    data = replace(data, values=data.values * factors, scale="unknown per response")
    diagnosis = diagnose_spectra(data, rig)
    assert diagnosis.verdict == EXPLAINED
    (finding,) = diagnosis.findings
    assert (finding.effect.cause, finding.effect.location) == ("mass_change", "mass5")
    found = finding.parameters["delta_mass"]
    assert abs(found.value - 0.1) < 4 * found.std
    assert any("scale of the responses is unknown" in warning for warning in diagnosis.warnings)


@pytest.mark.parametrize(
    ("word", "hidden"),
    [
        ("known", set()),
        ("unknown per input", {"actuator_gain"}),
        ("unknown per response", {"actuator_gain", "sensor_gain"}),
    ],
)
def test_an_unknown_scale_hides_gains(rig, word, hidden):
    known = set(Responses.of(responses(rig, 0.01, 1, 0.0), band=None).visible)
    seen = set(Responses.of(replace(responses(rig, 0.01, 1, 0.0), scale=word), band=None).visible)
    assert known - seen == hidden


def complex_noise(rng, shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)


def test_errors_that_grow_with_the_response_are_told_from_even_ones():
    rng = np.random.default_rng(2)
    values = np.exp(3 * np.sin(np.linspace(0, 20, 2000)))[:, None, None] * np.ones((1, 1, 2), dtype=complex)
    even = 0.1 * complex_noise(rng, (2000, 1))
    growing = 0.1 * np.hypot(np.abs(values[:, :, 1]), 1.0) * complex_noise(rng, (2000, 1))
    floors = noise_floors(values, np.stack([even, growing], axis=2))
    assert floors[0, 0] == np.inf
    # The grid of levels has steps of a factor 1.6, and 2000 lines tell the next from the best.
    assert 1 / 1.7 < floors[0, 1] < 1.7
    assert np.all(spread_of(values, floors)[:, 0, 0] == 1.0)


def test_a_baseline_covers_errors_as_large_as_its_own_and_no_larger(rig):
    likelihood = likelihood_of(rig, responses(rig, 0.1, 3, 0.0))
    found = fit(likelihood, np.zeros(21), (), likelihood.nuisance_mean)
    predicted = likelihood.predict(found.theta, (), found.nuisance)
    lesson = lesson_of(likelihood, predicted, np.full((3, 1), np.inf))
    rng, alarms = np.random.default_rng(4), 0
    for _ in range(200):
        level = np.sqrt(np.mean(np.abs(likelihood.error(predicted)) ** 2, axis=0))
        again = replace(likelihood, values=predicted + level * complex_noise(rng, predicted.shape))
        alarms += lesson.excess(again, predicted) is not None
    # LEVEL for all pairs together, so that three alarms in 200 have a probability of 0.1 %.
    assert alarms <= max(2, 10 * LEVEL * 200)
    twice = replace(again, values=predicted + 2 * (again.values - predicted))
    ratio, _ = lesson.excess(twice, predicted)
    assert ratio == pytest.approx(2.0, rel=0.3)


def test_a_number_that_is_known_is_no_candidate(rig):
    data = responses(EFFECTS["mass_change"]("mass5", delta_mass=0.1).apply(rig), 0.01, 5, 0.0)
    parameters = parameters_of(twin(rig), {"mass": 0.0, "mass mass3": 0.005})
    likelihood = Responses.of(data, band=None).likelihood(twin(rig), parameters, rig)
    found = fit(likelihood, np.zeros(21), (), likelihood.nuisance_mean, iterations=3)
    only = {"mass_change": EFFECTS["mass_change"]}
    candidates, looks = changes(likelihood, found, only, [found])
    assert looks == 1
    assert {c.location for c in candidates} <= {"mass3"}
    known = [k for k, name in enumerate(parameters.names) if name.startswith("mass") and name != "mass mass3"]
    np.testing.assert_array_equal(found.theta[known], 0.0)
