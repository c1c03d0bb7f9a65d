"""Virtual instruments: presets and settings become stages of the chain, in the units of a data sheet."""

import json
import math

import numpy as np
import pytest

import lab
from lab.chain import Chain
from lab.errors import LabError, UnknownNameError
from lab.excitation import Random
from lab.instruments import PRESETS, instrument
from lab.rig import Rig
from lab.stages import ALL, Delay, Dropout, Gain, Lag, LowPass, Noise, Resolution, Saturation
from tests.lab.structures import oscillator

RIG = Rig.from_xml(oscillator()).connected(outputs=["pos", "vel", "acc.x"])
SENSOR_OF = {"accelerometer": "acc.x", "velocity_sensor": "vel", "displacement_sensor": "pos"}
EVERY = [(kind, preset) for kind, presets in PRESETS.items() for preset in presets]


def equipped(**settings):
    return instrument(RIG, sample_rate=100.0, **settings).chain


@pytest.mark.parametrize(("kind", "preset"), EVERY)
def test_presets_build_and_survive_json(kind, preset):
    chain = equipped(**{kind: preset})
    assert Chain.from_data(json.loads(json.dumps(chain.to_data()))) == chain
    # An ideal instrument does nothing to a signal.
    stages = (chain.actuators, chain.sensors, chain.force_sensors, chain.acquisition)
    assert any(stages) == (preset != "ideal")


@pytest.mark.parametrize(("kind", "preset"), EVERY)
def test_presets_measure(kind, preset):
    """A short test through every preset: finite signals that are not far from the ideal ones."""
    settings = {"sample_rate": 100.0, "duration": 1.0, "accuracy": 1e-3}
    ideal = lab.simulate(RIG, Random(rms=5.0), **settings).records[0]
    real = lab.simulate(
        instrument(RIG, sample_rate=100.0, **{kind: preset}), Random(rms=5.0), **settings
    ).records[0]
    # Real ones are delayed by filters and clipped at their range, and of the same size otherwise.
    for a, b in ((ideal.inputs, real.inputs), (ideal.outputs, real.outputs)):
        assert np.all(np.isfinite(b))
        assert np.all(np.std(b, axis=1) < 1.3 * np.std(a, axis=1))
        assert np.all(np.std(b, axis=1) > 0)


@pytest.mark.parametrize("kind", SENSOR_OF)
def test_every_value_of_a_sensor_becomes_a_stage_of_its_channel(kind):
    settings = {
        "sensitivity_error": 0.02,
        "noise_density": 1e-3,
        "range": 7.0,
        "resolution": 0.01,
        "bandwidth": 30.0,
    }
    chain, channel = equipped(**{kind: settings}), SENSOR_OF[kind]
    assert chain.sensors == (Lag(channel, 30.0), Gain(channel, 0.02), Saturation(channel, 7.0))
    assert chain.acquisition == (Noise(channel, density=1e-3), Resolution(channel, 0.01))
    assert not chain.force_measured


def test_every_value_of_a_shaker():
    chain = equipped(shaker={"gain_error": -0.01, "bandwidth": 300.0, "range": 10.0, "delay": 0.001})
    assert chain.actuators == (
        Delay("force", 0.001),
        Gain("force", -0.01),
        Saturation("force", 10.0),
        Lag("force", 300.0),
    )


def test_every_value_of_a_force_sensor():
    chain = equipped(
        force_sensor={"sensitivity_error": 0.02, "noise_density": 1e-3, "range": 7.0, "resolution": 0.01}
    )
    assert chain.force_measured
    assert chain.force_sensors == (
        Gain("force", 0.02),
        Saturation("force", 7.0),
        Noise("force", density=1e-3),
        Resolution("force", 0.01),
    )


def test_every_value_of_an_acquisition():
    chain = equipped(
        accelerometer={"sensitivity": 0.5},
        acquisition={
            "range": 10.0,
            "bits": 12,
            "anti_alias": 0.4,
            "anti_alias_order": 6,
            "delay": 0.002,
            "dropout": 0.01,
        },
    )
    # A corner of 0.4 of the sample rate; 10 V are 20 m/s² at 0.5 V per m/s²; 12 bits over both signs.
    assert chain.for_channel("sensors", "acc.x") == (Delay("acc.x", 0.002), LowPass("acc.x", 40.0, 6))
    assert chain.for_channel("acquisition", "acc.x") == (
        Saturation("acc.x", 20.0),
        Resolution("acc.x", 40.0 / 4096),
        Dropout("acc.x", 0.01),
    )
    # Without a sensitivity, a volt is a unit.
    assert chain.for_channel("acquisition", "pos")[0] == Saturation("pos", 10.0)


def test_sensor_comes_before_acquisition():
    chain = equipped(
        accelerometer={"bandwidth": 30.0, "noise_density": 1e-3},
        acquisition={"anti_alias": 0.4, "dropout": 0.1},
    )
    assert [s.name for s in chain.for_channel("sensors", "acc.x")] == ["lag", "low_pass"]
    assert [s.name for s in chain.for_channel("acquisition", "acc.x")] == ["noise", "dropout"]


def test_noise_in_percent_is_on_every_output():
    assert equipped(noise_percent=5.0).acquisition == (Noise(ALL, percent=5.0),)


def test_instruments_add_to_the_chain_there_is():
    rig = RIG.with_chain(RIG.chain.adding("sensors", Gain("pos", 1.0)))
    chain = instrument(rig, displacement_sensor={"range": 1.0}).chain
    assert chain.sensors == (Gain("pos", 1.0), Saturation("pos", 1.0))


def test_settings_start_from_a_preset():
    chain = equipped(accelerometer={"preset": "phone_8g", "bandwidth": 50.0})
    assert chain.sensors[0] == Lag("acc.x", 50.0)
    assert chain.sensors[1] == Saturation("acc.x", 8 * 9.80665)


def test_presets_look_like_their_data_sheets():
    """Figures that their names promise, in other units."""
    g = 9.80665
    assert PRESETS["accelerometer"]["piezo_100mv_g"].sensitivity * g == pytest.approx(0.1)
    assert PRESETS["accelerometer"]["seismic_10v_g"].sensitivity * g == pytest.approx(10)
    assert PRESETS["accelerometer"]["mems_2g"].range / g == pytest.approx(2)
    assert PRESETS["accelerometer"]["phone_8g"].range / g == pytest.approx(8)
    assert 0.01 / PRESETS["displacement_sensor"]["encoder_560_cm"].resolution == pytest.approx(560)
    assert PRESETS["displacement_sensor"]["laser_10mm"].range * 2 == pytest.approx(0.01)
    assert PRESETS["force_sensor"]["piezo_11mv_n"].sensitivity == pytest.approx(0.011)
    assert PRESETS["acquisition"]["lab_24bit"].bits == 24
    assert PRESETS["acquisition"]["logger_16bit"].bits == 16


@pytest.mark.parametrize("kind", PRESETS)
def test_unknown_presets_and_settings_list_what_there_is(kind):
    with pytest.raises(UnknownNameError, match=f"{kind} 'best' is unknown; there are ideal"):
        equipped(**{kind: "best"})
    with pytest.raises(UnknownNameError, match="'best' is unknown"):
        equipped(**{kind: {"preset": "best"}})
    with pytest.raises(LabError, match=f"{kind} has no setting 'colour'; expected preset, "):
        equipped(**{kind: {"colour": 1.0}})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"accelerometer": {"range": "wide"}}, "accelerometer setting range is 'wide'; expected a number"),
        ({"accelerometer": {"range": True}}, "range is True"),
        ({"accelerometer": {"range": -1.0}}, "range is -1.0; expected a positive number"),
        ({"accelerometer": {"noise_density": math.nan}}, "noise_density is nan"),
        ({"accelerometer": {"sensitivity": 0.0}}, "sensitivity is 0.0"),
        ({"acquisition": {"range": 10.0, "bits": 12.5}}, "bits is 12.5; expected a whole number"),
        ({"acquisition": {"bits": 12}}, "12 bits and no range"),
        ({"force_sensor": {"bandwidth": 100.0}}, "force_sensor has a bandwidth of 100.0 Hz"),
        ({"noise_percent": -1.0}, "noise_percent is -1.0"),
        ({"noise_percent": math.nan}, "noise_percent is nan"),
    ],
)
def test_values_that_make_no_sense(settings, message):
    with pytest.raises(LabError, match=message) as caught:
        equipped(**settings)
    assert "\n" not in str(caught.value)


def test_anti_alias_filter_needs_the_sample_rate():
    with pytest.raises(LabError, match="anti-alias filter follows the sample rate; give sample_rate"):
        instrument(RIG, acquisition="lab_24bit")


def test_only_forces_have_force_sensors():
    """The control of a servo is a position: no load cell reads it."""
    servo = oscillator().replace(
        '<motor name="force" joint="x"/>', '<position name="drive" joint="x" kp="9"/>'
    )
    chain = instrument(Rig.from_xml(servo), force_sensor={"range": 5.0}).chain
    assert not chain.force_sensors
    assert not chain.force_measured
