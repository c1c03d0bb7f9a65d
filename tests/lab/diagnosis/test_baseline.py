"""Baseline: a model that errs in its known state is held to no more than that, and large changes are found."""

from dataclasses import replace

import numpy as np
import pytest

import lab
from identification.recording import Record
from lab.diagnosis.calibrate import parameters_of, survey_of
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.misfit import Misfit
from lab.effects import EFFECTS
from lab.twin import twin
from tests.lab.structures import chain_xml

LINEAR = {
    name: EFFECTS[name] for name in ("mass_change", "stiffness_change", "damping_change", "sensor_gain")
}
"""Causes that cannot stand for what the model lacks."""


def cart():
    rig = lab.Rig.from_xml(chain_xml([1.0], [(400.0, 2.0)], {}))
    return rig.connected(inputs=["force0"], outputs=["pos0"])


def rubbing(rig):
    """The rig as it really is: with dry friction and a spring that is stiffer one way."""
    spring = rig.springs[0].name
    rig = EFFECTS["coulomb_friction"](spring, force=1.0).apply(rig)
    return EFFECTS["bilinear_stiffness"](spring, relative_change_in_extension=0.2).apply(rig)


def recorded(rig, seed):
    """A random test of 20 s with noise of 1 %."""
    force = lab.EXCITATIONS["random"](rms=5.0)
    clean = lab.simulate(rig, force, sample_rate=50.0, duration=20.0, seed=seed, accuracy=1e-2)
    record = clean.records[0]
    noise = np.random.default_rng(seed).standard_normal(record.outputs.shape)
    level = 0.01 * np.std(record.outputs, axis=1, keepdims=True)
    return replace(clean, records=(Record("random", record.inputs, record.outputs + level * noise),))


def test_the_same_state_is_consistent_with_a_baseline_that_the_model_does_not_explain():
    real = rubbing(cart())
    first, again = recorded(real, 1), recorded(real, 2)
    assert lab.diagnose(again, cart(), effects=LINEAR).verdict == "unexplained"
    found = lab.diagnose(again, cart(), baseline=first, effects=LINEAR)
    assert found.verdict == "consistent"
    assert any("errs in the baseline too" in warning for warning in found.warnings)


@pytest.mark.slow
def test_what_the_baseline_shows_as_well_is_no_change():
    real = rubbing(cart())
    found = lab.diagnose(recorded(real, 2), cart(), baseline=recorded(real, 1))
    assert (found.verdict, found.findings) == ("consistent", ())


def test_a_large_change_is_found_through_the_errors_of_the_model():
    real = rubbing(cart())
    heavier = EFFECTS["mass_change"](real.bodies[0], delta_mass=1.0).apply(real)
    found = lab.diagnose(recorded(heavier, 2), cart(), baseline=recorded(real, 1), effects=LINEAR)
    # Friction slows a heavier cart differently, so that its damping may be found changed too.
    (change,) = [f.parameters["delta_mass"] for f in found.findings if f.effect.cause == "mass_change"]
    # What errs is the model, not the noise: the error bar is asked to be of the right size only.
    assert abs(change.value - 1.0) < 4 * change.std
    assert 0.003 < change.std < 0.2


@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_a_change_beyond_the_reach_of_slopes_is_found_without_noise(factor):
    spring = cart().springs[0].name
    real = EFFECTS["stiffness_change"](spring, relative_change=factor - 1).apply(cart())
    found = lab.diagnose(recorded(real, 3), cart(), effects=LINEAR)
    assert [(f.effect.cause, f.effect.location) for f in found.findings] == [("stiffness_change", spring)]
    change = found.findings[0].parameters["relative_change"]
    # The tolerance of the nominal stiffness, 2 %, is part of the error bar.
    assert change.value == pytest.approx(factor - 1, abs=0.1 * factor)


def dragging():
    """A cart on a spring that drags a rope with a memory, as an unpowered motor behind a rack does."""
    rig = lab.Rig.from_xml(chain_xml([0.8], [(680.0, 0.05)], {})).connected(
        inputs=["force0"], outputs=["pos0"]
    )
    drag = EFFECTS["hysteresis"](rig.springs[0].name, stiffness=280.0, yield_displacement=2.5e-3)
    return drag.apply(rig)


def let_go(rig, seed):
    """Two releases of 1.5 s, with noise, of a spring that is a little stiffer one way."""
    real = EFFECTS["bilinear_stiffness"](rig.springs[0].name, relative_change_in_extension=0.1).apply(rig)
    records = []
    for start in (0.015, 0.012):
        load = lab.EXCITATIONS["free_decay"]({rig.dofs[0]: start})
        made = lab.simulate(real, load, sample_rate=200.0, duration=1.5, accuracy=1e-2)
        y = made.records[0].outputs
        noise = np.random.default_rng(seed).standard_normal(y.shape)
        records.append(Record("free_decay", np.zeros((0, y.shape[1])), y + 2e-5 * noise))
    return replace(made, records=tuple(records))


def test_a_large_change_is_found_in_a_release_under_a_law_of_force():
    nominal = dragging()
    heavier = EFFECTS["mass_change"](nominal.bodies[0], delta_mass=1.0).apply(nominal)
    known = {**LINEAR, "hysteresis": EFFECTS["hysteresis"]}
    found = lab.diagnose(let_go(heavier, 2), nominal, baseline=let_go(nominal, 1), effects=known)
    # The motion at the start is not known: what a linear cart would start with fits no trial mass.
    change = found.findings[0]
    assert (change.effect.cause, change.effect.location) == ("mass_change", nominal.bodies[0])
    assert change.parameters["delta_mass"].value == pytest.approx(1.0, abs=0.15)


def test_causes_that_add_degrees_of_freedom_come_last_in_any_order():
    rig = lab.Rig.from_xml(chain_xml([1.0, 2.0], [(400.0, 1.0), (0.0, 0.0)], {(0, 1): (900.0, 1.5)}))
    rig = rig.connected(inputs=["force0"], outputs=["pos0", "pos1"])
    recording = recorded(rig, 4)
    misfit = Misfit.of(recording, twin(rig), parameters_of(twin(rig)))
    theta = np.zeros(misfit.parameters.n)
    survey = survey_of(misfit, rig, theta)
    misfit = Misfit(misfit.twin, misfit.parameters, misfit.records, misfit.dt, misfit.n_train, survey)

    def hypothesis(cause, location):
        kind = EFFECTS[cause]
        return Hypothesis.starting(kind, location, kind.guesses(survey, location)[0])

    added = hypothesis("attached_oscillator", rig.bodies[0])
    other = hypothesis("attached_oscillator", rig.bodies[1])
    law = hypothesis("cubic_stiffness", rig.springs[0].name)
    a, b = misfit.residual(theta, (added, other, law)), misfit.residual(theta, (law, added, other))
    # The same plant, its states in the same order: equal to the last bit.
    np.testing.assert_array_equal(a, b)
    assert misfit.plant(theta, (added, other, law)).n_dofs == 4
