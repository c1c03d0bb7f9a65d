"""Accuracy: simulated responses against exact ones, and the error on record."""

import dataclasses
import math

import numpy as np
import pytest

from lab import accuracy
from lab.chain import Chain
from lab.errors import LabError
from lab.excitation import Pulse, Random
from lab.rig import Rig
from lab.stages import Noise, Resolution
from tests.lab.oscillating import ONE, WHITE, one, relative, run
from tests.lab.structures import (
    LINEAR,
    MODELS,
    moving,
    oscillator,
    true_error,
)


def check_accuracy(recording, structure, accuracy):
    """The true error is within the accuracy, and within a factor of two of the error on record."""
    error, stated = true_error(recording, structure), recording.attributes["simulation_error"]
    assert error <= accuracy
    assert recording.attributes["simulation_accuracy"] == accuracy
    # Rounding puts a floor under both.
    assert stated / 2 - 1e-14 <= error <= 2 * stated + 1e-14


@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
@pytest.mark.parametrize("name", LINEAR)
def test_default_accuracy(name, drive):
    rate, structure = LINEAR[name]
    rig = moving(name)
    # Two inputs, for speed; all of them below.
    rig = rig.connected(inputs=[rig.inputs[0].name, rig.inputs[-1].name])
    check_accuracy(run(rig, drive, sample_rate=rate, duration=120 / rate, seed=3), structure, 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
@pytest.mark.parametrize("name", LINEAR)
def test_default_accuracy_of_every_channel_over_a_long_record(name, drive):
    rate, structure = LINEAR[name]
    check_accuracy(run(moving(name), drive, sample_rate=rate, duration=1000 / rate), structure, 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({path.stem for path in MODELS.glob("*.xml")} - set(LINEAR)))
def test_default_accuracy_of_any_other_linear_model(name):
    """Against the model's own truth, for models whose equations the tests do not write down."""
    rig = moving(name)
    if not rig.linear:
        pytest.skip("not linear: see the tests of the models")
    rate = float(4 * np.max(rig.modes().frequency_hz))
    recording = run(rig, WHITE, sample_rate=rate, duration=300 / rate)
    exact = rig.state_space().sampled(1 / rate).simulate(np.asarray(recording.records[0].inputs))
    error = relative(recording.records[0].outputs, exact)
    assert error <= 1e-9
    assert (
        recording.attributes["simulation_error"] / 2 <= error <= 2 * recording.attributes["simulation_error"]
    )


@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
@pytest.mark.parametrize("name", ["chain3_uncoupled", "chain3_coupled"])
def test_twelve_digits(name, drive):
    rate, structure = LINEAR[name]
    check_accuracy(run(moving(name), drive, sample_rate=rate, accuracy=1e-12), structure, 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
@pytest.mark.parametrize("name", ["chain7", "truss"])
def test_twelve_digits_of_larger_models(name, drive):
    rate, structure = LINEAR[name]
    rig = moving(name)
    rig = rig.connected(inputs=[c.name for c in rig.inputs[:3]])
    check_accuracy(run(rig, drive, sample_rate=rate, accuracy=1e-12), structure, 1e-12)


@pytest.mark.parametrize(("damping_ratio", "duration"), [(1e-3, 250.0), (0.0, 250.0)])
def test_errors_that_build_up_slowly_are_seen(damping_ratio, duration, monkeypatch):
    """A lightly damped mode gathers the error of many samples, long after the trial run."""
    # The trial run ends before the error does.
    monkeypatch.setattr(accuracy, "MOST_PILOT_SAMPLES", 512)
    damping = 2 * damping_ratio * math.sqrt(2.0 * 50.0)
    rig, structure = one(damping=damping), dataclasses.replace(ONE, damping=[[damping]])
    recording = run(rig, Pulse(), sample_rate=4.0, duration=duration, accuracy=1e-6)
    error, stated = true_error(recording, structure), recording.attributes["simulation_error"]
    assert error <= 1e-6
    # Far from rounding, and honest; what the error may grow by after the trial run is an upper bound.
    assert error <= 1.1 * stated
    assert stated <= 10 * error


def test_accuracy_follows_the_noise():
    """The default is a thousandth of the smallest noise, relative to the largest value of the channel."""
    clean = run(one(), WHITE, seed=1).records[0].outputs
    for percent in (5.0, 0.1):
        noisy = run(one(Chain(acquisition=(Noise("vel", percent=percent),))), WHITE, seed=1)
        rms, largest = np.sqrt(np.mean(clean[1] ** 2)), np.max(np.abs(clean[1]))
        expected = 1e-3 * percent / 100 * rms / largest
        # The noise is judged on a coarse trial run.
        assert noisy.attributes["simulation_accuracy"] == pytest.approx(expected, rel=1e-3)
        assert noisy.attributes["simulation_error"] <= expected
    finest = run(one(Chain(acquisition=(Noise("*", percent=5.0), Resolution("pos", 1e-6)))), WHITE, seed=1)
    # Percent and rounding errors of one channel add up; the least disturbed channel counts.
    shares = [0.05 * np.sqrt(np.mean(y**2)) / np.max(np.abs(y)) for y in clean]
    assert finest.attributes["simulation_accuracy"] == pytest.approx(1e-3 * min(shares), rel=1e-3)


def test_an_accuracy_out_of_reach_is_refused():
    kinked = oscillator(
        extra='<tendon><fixed name="stop" stiffness="900" springlength="-1e6 0.05"><joint joint="x" coef="1"/></fixed></tendon>'
    )
    with pytest.raises(
        LabError, match=r"accuracy of 1.0e-13 is out of reach: the error is .* with \d+ substeps"
    ):
        run(Rig.from_xml(kinked), Random(rms=50.0), duration=0.3, accuracy=1e-13)
