"""Twins: matrices and laws of a rig, and what they cannot hold."""

from dataclasses import replace

import numpy as np
import pytest

import lab
from lab.effects import EFFECTS
from lab.effects.edits import with_mass
from lab.errors import RigError
from lab.responder import ready
from lab.rig import Rig
from lab.simulate import simulate
from lab.stages import Gain, Lag, LowPass, Saturation
from lab.twin import twin
from tests.lab import structures
from tests.lab.effects.cases import CASES
from tests.lab.effects.reference import GROUND, JOINED, MASSES, C_d, K, M, nominal
from tests.lab.effects.test_effects import surveyed


@pytest.mark.parametrize("name", [*structures.LINEAR, "truss_spatial"])
def test_matrices_are_those_of_the_rig(name):
    rig = structures.moving(name)
    plant, truth = twin(rig).plant, rig.second_order()
    for found, true in (
        (plant.mass, truth.mass),
        (plant.damping, truth.damping),
        (plant.stiffness, truth.stiffness),
    ):
        np.testing.assert_allclose(found, true, rtol=0, atol=1e-12 * np.max(np.abs(true)))


def test_parts_make_up_the_whole():
    t = twin(nominal())
    assert t.bodies == ("mass0", "mass1", "mass2")
    assert t.springs == ("q0", "q2", "spring0_1", "spring1_2")
    np.testing.assert_allclose(t.masses.sum(axis=0), M, atol=1e-12)
    np.testing.assert_allclose(t.rows.T @ (t.stiffness[:, None] * t.rows), K, atol=1e-12)
    np.testing.assert_allclose(t.rows.T @ (t.damping[:, None] * t.rows), C_d, atol=1e-12)
    np.testing.assert_allclose(t.body_mass, MASSES, atol=1e-12)


def test_changed_factors():
    t = twin(nominal())
    mass, stiffness, damping = np.array([1.1, 1, 1]), np.array([1, 1, 0.5, 1]), np.array([1, 2.0, 1, 1])
    plant = t.changed(mass, stiffness, damping)
    k, c = JOINED[(0, 1)][0], GROUND[2][1]
    row = np.array([-1.0, 1.0, 0.0])
    np.testing.assert_allclose(plant.mass, M + np.diag([0.1, 0, 0]), atol=1e-12)
    np.testing.assert_allclose(plant.stiffness, K - 0.5 * k * np.outer(row, row), atol=1e-12)
    np.testing.assert_allclose(plant.damping, C_d + np.diag([0, 0, c]), atol=1e-12)
    np.testing.assert_allclose(plant.spring_stiffness, t.stiffness * stiffness)


def test_each_body_of_the_truss_moves_two_ways():
    t = twin(structures.moving("truss"))
    for i, body in enumerate(t.masses):
        expected = np.zeros(8)
        expected[2 * i : 2 * i + 2] = 100
        np.testing.assert_allclose(body, np.diag(expected), atol=1e-9)


def test_an_inclined_bar_hardens_alike_in_truss_and_twin():
    rig = structures.moving("truss").connected(inputs=["force_v1"], outputs=["acc2.x", "pos_u1"])
    rig = EFFECTS["cubic_stiffness"]("bar1_4", k3=2e7).apply(rig)
    drive = lab.EXCITATIONS["random"](rms=100.0)
    recording = simulate(rig, drive, sample_rate=50.0, duration=4.0, accuracy=1e-8)
    u, y = (np.asarray(x) for x in (recording.records[0].inputs, recording.records[0].outputs))
    found = ready(twin(rig).plant, 1 / 50, substeps=48).outputs(u, u.shape[1])
    straight = ready(
        twin(structures.moving("truss").connected(inputs=["force_v1"], outputs=["acc2.x", "pos_u1"])).plant,
        1 / 50,
    )
    scale = np.max(np.abs(y), axis=1)
    assert np.max(np.max(np.abs(straight.outputs(u, u.shape[1]) - y), axis=1) / scale) > 0.02
    # Second order in the substep.
    assert np.max(np.max(np.abs(found - y), axis=1) / scale) < 1e-3


def test_names_of_nameless_elements_are_found_again():
    named = structures.chain_xml(MASSES, GROUND, JOINED)
    nameless = named.replace('<body name="mass1"', "<body")
    rig = Rig.from_xml(nameless)
    assert rig.bodies == ("mass0", "body2", "mass2")
    changed = EFFECTS["mass_change"]("body2", delta_mass=0.5).apply(rig)
    np.testing.assert_allclose(changed.second_order().mass, M + np.diag([0, 0.5, 0]), atol=1e-12)
    assert EFFECTS["missing_spring"].places(rig) == ("world|body2", "mass0|mass2")
    np.testing.assert_allclose(twin(rig).masses, twin(Rig.from_xml(named)).masses)
    tied = EFFECTS["missing_spring"]("world|body2", stiffness=12.0).apply(rig)
    np.testing.assert_allclose(tied.second_order().stiffness, K + np.diag([0, 12.0, 0]), atol=1e-12)


def test_mass_and_inertia_grow_together():
    rig = with_mass(nominal(), "mass1", 1.5)
    before, after = nominal().model.body("mass1"), rig.model.body("mass1")
    np.testing.assert_allclose(after.mass, 1.5 * before.mass, rtol=1e-15)
    np.testing.assert_allclose(after.inertia, 1.5 * before.inertia, rtol=1e-15)


@pytest.mark.parametrize(
    ("place", "stages", "says"),
    [
        (
            "sensors",
            (LowPass("acc0.x", 5.0),),
            "stage 'low_pass' on channel 'acc0.x' is not known to a plant",
        ),
        (
            "sensors",
            (Saturation("acc0.x", 1.0), Gain("acc0.x", 0.5)),
            "passes saturation, gain; a plant knows lag",
        ),
        ("sensors", (Lag("acc0.x", 1.0), Lag("acc0.x", 2.0)), "each lag once"),
        ("actuators", (Lag("force0", 1.0), Saturation("force0", 2.0)), "passes lag, saturation"),
    ],
)
def test_a_chain_that_no_plant_can_hold(place, stages, says):
    rig = nominal()
    with pytest.raises(RigError, match=says):
        twin(rig.with_chain(rig.chain.adding(place, *stages)))


def test_effects_come_in_the_order_of_a_plant():
    one, other = nominal(), nominal()
    effects = [
        EFFECTS["sensor_saturation"]("acc0.x", limit=0.5),
        EFFECTS["line_hum"]("acc0.x", frequency_hz=3.0, amplitude=0.1),
        EFFECTS["sensor_gain"]("acc0.x", relative_change=0.2),
        EFFECTS["sensor_lag"]("acc0.x", corner_hz=4.0),
    ]
    for effect in effects:
        one = effect.apply(one)
    for effect in reversed(effects):
        other = effect.apply(other)
    assert one.chain == other.chain
    assert twin(one).plant.output_paths == twin(other).plant.output_paths


def test_readings_that_are_no_motion():
    xml = structures.oscillator(extra="").replace(
        "<accelerometer", '<actuatorfrc name="push" actuator="force"/><accelerometer'
    )
    with pytest.raises(RigError, match="output 'push' is no motion"):
        twin(Rig.from_xml(xml))


def test_actuators_with_a_life_of_their_own():
    xml = structures.oscillator().replace(
        '<motor name="force" joint="x"/>', '<general name="force" joint="x" dyntype="filter" dynprm="0.1"/>'
    )
    with pytest.raises(RigError, match="dynamics of their own"):
        twin(Rig.from_xml(xml))


@pytest.mark.parametrize("model", ["chain7", "truss"])
def test_every_effect_anywhere_explains_what_it_does(model):
    """At small amplitude: the bars of the truss are fixed tendons, and a missing spring there would bend."""
    rig = structures.moving(model)
    survey, u = surveyed(rig), 1e-3 * np.random.default_rng(0).standard_normal((len(rig.inputs), 40))
    dt = 0.02
    for cause, effect in EFFECTS.items():
        example = next(case.effect for case in CASES.values() if case.effect.cause == cause)
        for place in effect.places(rig)[:: 5 if model == "truss" else 3]:
            here = replace(example, location=place)
            one, other = here.explain(survey.twin.plant, survey), twin(here.apply(rig)).plant
            a, b = (ready(plant, dt, substeps=6).outputs(u, 40) for plant in (one, other))
            # Freeplay is an extra law on one side, a missing spring on the other: they meet at second order.
            bound = 0.05 if cause == "freeplay" else 1e-9
            assert np.max(np.abs(a - b)) < bound * np.max(np.abs(a)), (cause, place)
