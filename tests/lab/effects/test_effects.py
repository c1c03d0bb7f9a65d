"""Every cause of the catalogue, hidden and explained, held against its law worked out without the library."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache

import mujoco
import numpy as np
import pytest

import lab
from lab.effects import EFFECTS, Effect
from lab.effects.survey import Survey
from lab.errors import LabError, UnknownNameError
from lab.plant import Plant
from lab.responder import ready
from lab.rig import Rig
from lab.simulate import simulate
from lab.stepping import Stepper
from lab.twin import twin
from tests.lab import structures
from tests.lab.effects.cases import CASES
from tests.lab.effects.reference import DT, linear, nominal

N_SAMPLES = 200

every_case = pytest.mark.parametrize("name", CASES)
structural = pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.order])


def recorded(rig: Rig, accuracy: float | None = None):
    """A recording of the rig under random forces, the same for every rig."""
    drive = lab.EXCITATIONS["random"](rms=1.0)
    return simulate(rig, drive, sample_rate=1 / DT, duration=N_SAMPLES * DT, accuracy=accuracy)


@lru_cache
def inputs():
    return np.array(recorded(nominal(), 1e-3).records[0].inputs)


@lru_cache
def reference(name: str):
    return CASES[name].reference(inputs())


@lru_cache
def hidden(name: str) -> Rig:
    return CASES[name].effect.apply(nominal())


def error(found, truth) -> float:
    """Largest difference of a channel over its largest value, at worst."""
    return float(np.max(np.max(np.abs(found - truth), axis=1) / np.max(np.abs(truth), axis=1)))


def stepped(rig: Rig, substeps: int):
    """Readings by MuJoCo alone with that many steps a sample."""
    still, u = np.zeros((1, len(rig.dofs))), inputs()
    controls = np.zeros((1, rig.model.nu, N_SAMPLES * substeps))
    for row, channel in zip(u, rig.inputs, strict=True):
        controls[0, rig.control_of(channel.name)] = np.repeat(row, substeps)
    readings, _ = Stepper(rig, DT, substeps, still, still, N_SAMPLES * DT).advance(controls, None)
    return readings[0][[rig.row_of(channel.name) for channel in rig.outputs]][:, ::substeps]


def surveyed(rig: Rig) -> Survey:
    """A survey of motion of about the right size."""
    n, n_out, n_in = len(rig.dofs), len(rig.outputs), len(rig.inputs)
    return Survey(
        rig,
        twin(rig),
        covariance=1e-3 * np.eye(n),
        speed_covariance=1e-2 * np.eye(n),
        force_rms=np.ones(n),
        output_rms=np.ones(n_out),
        output_peak=3 * np.ones(n_out),
        input_rms=np.ones(n_in),
        input_peak=3 * np.ones(n_in),
        tones=((2.0,),) * n_out,
        common_tones=(1.0,),
        dt=DT,
        duration=N_SAMPLES * DT,
    )


def response(plant: Plant, substeps: int = 24):
    return ready(plant, DT, substeps=substeps).outputs(inputs(), N_SAMPLES)


def test_every_cause_has_a_case():
    assert {case.effect.cause for case in CASES.values()} == set(EFFECTS)


def test_the_reference_is_the_structure_of_the_rig():
    assert error(np.array(recorded(nominal()).records[0].outputs), linear(inputs())) < 1e-9


@every_case
def test_the_effect_changes_the_response(name):
    # Otherwise the other tests would prove nothing.
    assert error(reference(name), linear(inputs())) > 0.05


@structural
def test_steps_converge_to_the_law(name):
    rows = list(CASES[name].steady)
    coarse, fine = (error(stepped(hidden(name), n)[rows], reference(name)[rows]) for n in (4, 64))
    # Kinks fall anywhere within a step, so that the observed order scatters about the expected one.
    assert np.log(coarse / fine) / np.log(16) > CASES[name].order - 0.4
    # Fourth order with ω h near 0.01 leaves 1e-9; a kink leaves its share of a step squared; MuJoCo's dry friction is soft.
    assert fine < {4.0: 2e-9, 3.0: 1e-7, 2.0: 1e-5, 1.0: 1e-2}[CASES[name].order]


@every_case
def test_the_bench_records_the_law(name):
    smooth = CASES[name].order in (None, 4.0)
    recording = recorded(
        hidden(name), None if smooth else {3.0: 1e-6, 2.0: 1e-4, 1.0: 1e-2}[CASES[name].order]
    )
    rows = list(CASES[name].steady)
    found = np.array(recording.records[0].outputs)[rows]
    np.testing.assert_array_equal(recording.records[0].inputs, inputs())
    # The bench measures its error against twice the steps: half of a first-order error shows.
    assert error(found, reference(name)[rows]) < 2.5 * recording.attributes["simulation_error"] + 1e-9


@every_case
def test_the_twin_follows_the_law(name):
    assert error(response(twin(hidden(name)).plant), reference(name)) < CASES[name].twin


@every_case
def test_explaining_is_hiding_on_the_twin(name):
    survey = surveyed(nominal())
    explained = CASES[name].effect.explain(survey.twin.plant, survey)
    one, other = response(explained), response(twin(hidden(name)).plant)
    assert error(one, reference(name)) < CASES[name].twin
    # Freeplay is an extra law on one side and a missing spring on the other; all else is the same arithmetic.
    assert error(one, other) < (CASES[name].twin if name == "freeplay" else 1e-12)


@every_case
def test_a_file_keeps_the_effect(name, tmp_path):
    rig = hidden(name)
    rig.save(tmp_path / "extended.xml")
    again = Rig.load(tmp_path / "extended.xml")
    assert again.chain == rig.chain
    np.testing.assert_array_equal(response(twin(again).plant, 6), response(twin(rig).plant, 6))
    if CASES[name].order:
        np.testing.assert_array_equal(stepped(again, 4), stepped(rig, 4))


@every_case
def test_plain_mujoco_runs_the_file(name, tmp_path):
    hidden(name).save(tmp_path / "extended.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "extended.xml"))
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    for _ in range(20):
        mujoco.mj_step(model, data)
    assert np.all(np.isfinite(data.qpos))
    assert np.any(data.qpos != 0)


@every_case
def test_plain_data_hold_the_effect(name):
    effect = CASES[name].effect
    data = json.loads(json.dumps(effect.to_data()))
    assert EFFECTS[data.pop("cause")](**data) == effect


@every_case
def test_parameters_have_units(name):
    effect = CASES[name].effect
    assert set(effect.parameters) <= set(effect.units)
    assert set(effect.positive) <= set(effect.units)
    assert effect.parameters or name == "sensor swap"


@pytest.mark.parametrize("cause", EFFECTS)
def test_places_exist_and_take_the_effect(cause):
    rig = nominal()
    places = EFFECTS[cause].places(rig)
    assert places
    assert len(set(places)) == len(places)
    example = next(case.effect for case in CASES.values() if case.effect.cause == cause)
    if "limit" in example.units:
        # Channels differ in size; this one every channel meets.
        example = replace(example, limit=0.01)
    plant = twin(rig).plant
    for place in places:
        changed = twin(replace(example, location=place).apply(rig)).plant
        assert not np.array_equal(response(changed, 2), response(plant, 2)), place


@pytest.mark.parametrize("cause", EFFECTS)
def test_a_wrong_place_is_one_line(cause):
    example = next(case.effect for case in CASES.values() if case.effect.cause == cause)
    with pytest.raises(UnknownNameError, match=r"'nowhere'") as caught:
        replace(example, location="nowhere").apply(nominal())
    assert "\n" not in str(caught.value)


WRONG = {
    "mass_change": {"delta_mass": -2.0},
    "stiffness_change": {"relative_change": -1.5},
    "damping_change": {"relative_change": float("nan")},
    "missing_spring": {"stiffness": float("inf")},
    "attached_oscillator": {"mass": 0.0},
    "cubic_stiffness": {"k3": float("nan")},
    "bilinear_stiffness": {"relative_change_in_extension": float("nan")},
    "freeplay": {"half_gap": 0.0},
    "gap_contact": {"contact_stiffness": -1.0},
    "coulomb_friction": {"force": -1.0},
    "quadratic_damping": {"c2": float("inf")},
    "hysteresis": {"yield_displacement": 0.0},
    "stiffness_drift": {"relative_change_over_record": float("nan")},
    "unmeasured_force": {"amplitude": None},
    "sensor_gain": {"relative_change": float("nan")},
    "sensor_delay": {"delay": -0.1},
    "sensor_lag": {"corner_hz": 0.0},
    "sensor_saturation": {"limit": 0.0},
    "sensor_swap": {"location": "acc0.x|acc0.x"},
    "line_hum": {"frequency_hz": 0.0},
    "actuator_gain": {"relative_change": float("inf")},
    "actuator_lag": {"time_constant": 0.0},
    "actuator_delay": {"delay": 0.0},
    "actuator_saturation": {"limit": float("nan")},
}


@pytest.mark.parametrize("cause", EFFECTS)
def test_a_wrong_size_is_one_line(cause):
    example = next(case.effect for case in CASES.values() if case.effect.cause == cause)
    with pytest.raises(LabError, match=cause) as caught:
        replace(example, **WRONG[cause]).apply(nominal())
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("cause", EFFECTS)
def test_fits_start_where_the_effect_makes_sense(cause):
    survey = surveyed(nominal())
    effect = EFFECTS[cause]
    for place in effect.places(survey.rig):
        for guess in effect.guesses(survey, place):
            assert set(guess.start) == set(guess.scale)
            assert all(scale > 0 for scale in guess.scale.values())
            start = effect.of(place, {**guess.start, **(guess.fixed or {})})
            assert all(getattr(start, name) > 0 for name in effect.positive)
            assert np.all(np.isfinite(response(start.explain(survey.twin.plant, survey), 2)))


def test_parameters_of_the_model_are_not_searched_for():
    survey = surveyed(nominal())
    calibrated = {
        cause for cause in EFFECTS if not EFFECTS[cause].guesses(survey, EFFECTS[cause].places(survey.rig)[0])
    }
    assert calibrated == {"mass_change", "stiffness_change", "damping_change"}


# Of the founding models: bodies, springs, springs with stiffness (the joints of the truss are mere dampers), joints and
# springs that may rub, and pairs of bodies that no spring ties.
PLACES = {
    "chain3_uncoupled": {"body": 3, "spring": 6, "stiff": 6, "friction": 6, "missing": 0},
    "chain7": {"body": 7, "spring": 7, "stiff": 7, "friction": 14, "missing": 21},
    "truss": {"body": 4, "spring": 22, "stiff": 14, "friction": 22, "missing": 0},
}


@pytest.mark.parametrize("model", PLACES)
def test_places_of_the_founding_models(model):
    rig, count = structures.moving(model), PLACES[model]
    n_in, n_out = len(rig.inputs), len(rig.outputs)
    units = [channel.unit for channel in rig.outputs]
    alike = sum(units.count(unit) * (units.count(unit) - 1) // 2 for unit in set(units))
    for cause, effect in EFFECTS.items():
        if cause in ("mass_change", "attached_oscillator", "unmeasured_force"):
            expected = count["body"]
        elif cause == "coulomb_friction":
            expected = count["friction"]
        elif cause == "missing_spring":
            expected = count["missing"]
        elif cause == "sensor_swap":
            expected = alike
        elif cause.startswith(("sensor", "line")):
            expected = n_out
        elif cause.startswith("actuator"):
            expected = n_in
        elif cause in ("stiffness_change", "bilinear_stiffness", "freeplay", "stiffness_drift"):
            expected = count["stiff"]
        else:
            expected = count["spring"]
        assert len(effect.places(rig)) == expected, cause


def test_effects_of_the_catalogue_are_described():
    for cause, effect in EFFECTS.items():
        assert issubclass(effect, Effect)
        assert effect.cause == cause
        for parameter in effect.units:
            assert f"{parameter}:" in (effect.__doc__ or ""), (cause, parameter)
