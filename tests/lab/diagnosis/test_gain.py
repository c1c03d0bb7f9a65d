"""Gain: rigs are held against their own twins, where they have one."""

from dataclasses import replace

import numpy as np
import pytest

from identification.recording import Record
from lab.diagnosis import gain
from lab.diagnosis.gain import _by_the_twin
from lab.diagnosis.starts import motions_of
from lab.effects import EFFECTS
from lab.excitation import Random
from lab.replay import replay
from lab.rig import Rig
from lab.simulate import simulate

ACCURACY = 1e-4


@pytest.fixture(scope="module")
def rig():
    model = Rig.load("models/chain3_coupled.xml").connected(inputs=["force1"], outputs=["acc1.x", "acc3.x"])
    return EFFECTS["cubic_stiffness"]("spring2_3", k3=2.0).apply(model)


@pytest.fixture(scope="module")
def recording(rig):
    return simulate(rig, Random(rms=1.0), sample_rate=5.0, duration=30.0, seed=4)


@pytest.mark.parametrize("start", [None, (np.array([0.1, 0.0, -0.2]), np.array([0.0, 0.3, 0.1]))])
def test_a_rig_and_its_twin_move_alike(rig, recording, start):
    (simulated,) = replay(rig, recording, accuracy=ACCURACY, starts=[start])
    (found,) = _by_the_twin(rig, recording, [start], 96)
    # The twin errs with the square of its substep: a thousandth of it at 96 of them.
    assert np.sqrt(np.mean((found - simulated) ** 2)) < 10 * ACCURACY * np.sqrt(np.mean(simulated**2))


def test_what_is_replayed_is_held_against_the_twin(rig, recording, monkeypatch):
    seen = []

    def watched(*arguments, expected, **options):
        seen.extend(expected)
        return replay(*arguments, expected=expected, **options)

    monkeypatch.setattr(gain, "replay", watched)
    forced, decay = recording.records[0], recording.records[0].outputs[:, :]
    gap = decay.copy()
    gap[0, 10:20] = np.nan
    both = replace(
        recording,
        records=(
            replace(forced, outputs=gap),
            Record("free_decay", np.zeros((0, decay.shape[1])), decay),
        ),
    )
    start = np.array([0.1, 0.0, -0.2, 0.0, 0.3, 0.1])
    driven = rig, motions_of(rig, rig.dofs, (None, start))
    found = gain.simulated(both, driven, accuracy=1e-2, substeps=24)
    for simulated, expected in zip(found, seen, strict=True):
        assert np.sqrt(np.mean((simulated - expected) ** 2)) <= 1e-2 * np.sqrt(np.mean(expected**2))
    assert np.max(np.abs(found[1][:, 0])) > 0.1


def test_a_rig_that_no_twin_can_stand_for_has_none(recording):
    xml = """<mujoco><worldbody><body name="a"><joint name="x" type="slide" axis="1 0 0" stiffness="10" damping="0.1"/>
    <geom size="0.1" mass="1"/><site name="s"/></body></worldbody>
    <actuator><general name="force1" joint="x" dyntype="filter" dynprm="0.1"/></actuator>
    <sensor><accelerometer name="acc1" site="s"/></sensor></mujoco>"""
    assert _by_the_twin(Rig.from_xml(xml), recording, [None], 6) is None
