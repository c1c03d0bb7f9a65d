"""The restoring force comes from the measurements: it follows the true law even where a wrong one was named."""

from dataclasses import replace

import numpy as np
import pytest

from lab.diagnosis.outcome import EXPLAINED, Diagnosis, Errors, Finding, Prediction, Quantity
from lab.diagnosis.restoring import restoring_force
from lab.effects import EFFECTS
from lab.excitation import Random
from lab.instruments import instrument
from lab.rig import Rig
from lab.simulate import simulate

NOISE = 0.005


@pytest.fixture(scope="module")
def rig():
    # Springs of 1 N/m between masses and 2 N/m to the ground: 0.19 to 0.37 Hz.
    rig = Rig.load("models/chain3_coupled.xml")
    return rig.connected(inputs=["force1", "force3"], outputs=["acc1.x", "pos2", "acc3.x"])


def case(rig, hidden, named):
    recording = simulate(
        instrument(hidden.apply(rig), noise_percent=100 * NOISE),
        Random(rms=1.0),
        sample_rate=10.0,
        duration=100.0,
        seed=3,
    )
    y = np.asarray(recording.records[0].outputs[:, :])
    noise = {
        c.name: Quantity(NOISE * float(np.std(row)), 0.0, c.unit)
        for c, row in zip(recording.outputs, y, strict=True)
    }
    finding = Finding(named, {}, 100.0, 1.0, "")
    diagnosis = Diagnosis(
        EXPLAINED,
        (finding,),
        (),
        {},
        Errors(NOISE, 1.0, 1.0, NOISE),
        (Prediction(y, y, y, y, 700),),
        rig,
        named.apply(rig),
        (),
        noise=noise,
    )
    return diagnosis, recording


LAWS = {
    "cubic_stiffness": ({"k3": 3.0}, {"k3": 4.5}, "extension", lambda x: 1.0 * x + 3.0 * x**3),
    "quadratic_damping": ({"c2": 0.5}, {"c2": 0.75}, "rate", lambda v: 0.3 * v + 0.5 * abs(v) * v),
}


@pytest.mark.parametrize("cause", LAWS)
def test_the_dots_follow_the_truth_and_not_the_name(rig, cause):
    true, claimed, over, law = LAWS[cause]
    diagnosis, recording = case(
        rig, EFFECTS[cause]("spring2_3", **true), EFFECTS[cause]("spring2_3", **claimed)
    )
    found = restoring_force(diagnosis, recording)
    assert (found.location, found.over) == ("spring2_3", over)
    rms = np.sqrt(np.mean(law(found.x) ** 2))
    off = np.sqrt(np.mean((found.force - law(found.x)) ** 2)) / rms
    # Force straight between samples of 0.1 s, against a force of up to some 1 Hz: a few percent, and 0.5 % of noise.
    assert off < 0.1
    claimed_law = np.interp(found.x, *np.sort(np.stack([found.law_x, found.law_force])))
    assert np.sqrt(np.mean((found.force - claimed_law) ** 2)) / rms > 2 * off


def test_the_law_found_is_drawn_as_it_is(rig):
    effect = EFFECTS["cubic_stiffness"]("spring2_3", k3=3.0)
    found = restoring_force(*case(rig, effect, effect))
    # Solved from M a + C v + K q = B u - rᵀ f on the extended twin: rounding of sums and the kernel's substeps.
    np.testing.assert_allclose(found.law_force, found.law_x + 3.0 * found.law_x**3, atol=1e-6)
    assert found.linear == 1.0


def test_there_is_none_for_other_causes(rig):
    effect = EFFECTS["sensor_gain"]("pos2", relative_change=0.1)
    diagnosis, recording = case(rig, effect, effect)
    assert restoring_force(diagnosis, recording) is None
    assert restoring_force(replace(diagnosis, findings=()), recording) is None
