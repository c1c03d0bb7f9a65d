"""Responses to forces that vary continuously, against dynamic stiffness solved line by line and the limit of short samples."""

from dataclasses import replace

import numpy as np
import pytest

from lab.diagnosis.spectral.motion import survey_of
from lab.diagnosis.spectral.transfer import plant_response
from lab.plant import Path, Tone
from lab.responder import ready
from lab.rig import Rig
from lab.twin import twin

FREQUENCY = np.array([0.02, 0.5, 1.7, 3.3, 20.0, 400.0])


@pytest.fixture(scope="module")
def rig():
    return Rig.load("models/chain7.xml").connected(
        inputs=["force1", "force3"], outputs=["acc1.x", "pos2", "acc7.x"]
    )


@pytest.fixture(scope="module")
def plant(rig):
    return twin(rig).plant


def directly(plant, f):
    """Outputs per input by one solve of the dynamic stiffness."""
    s = 2j * np.pi * f
    X = np.linalg.solve(plant.mass * s**2 + plant.damping * s + plant.stiffness, plant.forces)
    return (plant.displacement + s * plant.velocity + s**2 * plant.acceleration) @ X


@pytest.mark.parametrize("decay", [0.0, 2.0])
def test_it_is_the_inverse_of_the_dynamic_stiffness(plant, decay):
    f = FREQUENCY - 1j * decay / (2 * np.pi)
    expected = np.stack([directly(plant, each) for each in f])
    found = plant_response(plant, f, dt=0.0)
    # Far above the resonances, the small displacement of distant masses is a difference of large terms.
    assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
    np.testing.assert_allclose(found[:5], expected[:5], rtol=1e-7)


def test_channels_lag_and_delay_as_in_continuous_time(plant):
    changed = plant.with_output(0, gain=1.3, delay=0.013, lag=0.01)
    changed = changed.with_output(1, band_limited_delay=0.004).with_output(2, band_limited_lag=0.002)
    changed = changed.with_input(0, delay=0.002, lag=0.03).with_input(1, held_lag=0.02, gain=-0.7)
    s = 2j * np.pi * FREQUENCY
    read = np.stack(
        [1.3 * np.exp(-0.013 * s) / (1 + 0.01 * s), np.exp(-0.004 * s), 1 / (1 + 0.002 * s)], axis=1
    )
    pushed = np.stack([np.exp(-0.002 * s) / (1 + 0.03 * s), -0.7 / (1 + 0.02 * s)], axis=1)
    expected = read[:, :, None] * plant_response(plant, FREQUENCY, dt=0.0) * pushed[:, None, :]
    np.testing.assert_allclose(plant_response(changed, FREQUENCY, dt=0.0), expected, rtol=1e-12)
    swapped = plant_response(replace(plant, order=(2, 1, 0)), FREQUENCY, dt=0.0)
    np.testing.assert_array_equal(swapped, plant_response(plant, FREQUENCY, dt=0.0)[:, ::-1])


def test_forces_of_tones_come_behind_the_inputs(plant):
    driven = replace(plant, tones=(Tone(plant.forces[:, 1], 1.0, 0.0, 0.0),))
    H = plant_response(driven, FREQUENCY[:5], dt=0.0)
    # The same force through another column: rounding only.
    np.testing.assert_allclose(H[:, :, 2], H[:, :, 1], rtol=1e-10)


def test_sampled_responses_of_displacement_approach_it_with_the_square_of_the_sample_time(plant):
    f = np.array([0.5, 1.7, 3.3])
    exact = plant_response(plant, f, dt=0.0)[:, 1]
    errors = []
    for dt in (0.01, 0.005):
        s = 2j * np.pi * f * dt
        held = (-np.expm1(-s) / s)[:, None]  # of a force that is held over each sample
        errors.append(np.abs(plant_response(plant, f, dt=dt)[:, 1] / held - exact).max())
    # What is folded down from beyond half the sample rate falls with its square or faster.
    assert errors[1] < errors[0] / 3.9


def test_band_limited_channels_of_sampled_responses_are_those_of_the_recorder(plant):
    dt, n = 0.02, 1 << 14
    plain = replace(plant, output_paths=(Path(),) * 3)
    late = plain.with_output(1, band_limited_delay=0.013).with_output(2, band_limited_lag=0.004)
    pulse = np.zeros((2, n))
    pulse[0, n // 4] = 1.0
    y = ready(late, dt).outputs(pulse, n)
    f = np.array([0.5, 1.7, 3.3, 20.0])
    turns = np.exp(-2j * np.pi * np.outer((np.arange(n) - n // 4) * dt, f))
    H = plant_response(late, f, dt=dt)[:, :, 0]
    # The ringing of the ideal filter falls off as one over time, and is cut off after 4000 samples.
    assert np.abs((y @ turns).T - H).max() < 1e-3 * np.abs(H).max()


def test_motion_under_continuous_forces_is_that_of_a_band_of_white_noise(rig, plant):
    survey = survey_of(
        rig, twin(rig), plant, np.ones(2), dt=0.0, duration=100.0, output_rms=np.ones(3), top_hz=30.0
    )
    f = (np.arange(60_000) + 0.5) * 30.0 / 60_000
    probe = replace(
        plant, displacement=np.eye(3, 7), velocity=np.zeros((3, 7)), acceleration=np.zeros((3, 7))
    )
    H = plant_response(probe, f, dt=0.0)
    # Unit power over the band; lines of both sums resolve the sharpest resonance to better than a hundredth.
    expected = np.einsum("foi,fpi->op", H, H.conj()).real / f.size
    np.testing.assert_allclose(survey.covariance[:3, :3], expected, rtol=0.02, atol=1e-3 * expected.max())
    assert survey.dt == 1 / 60
