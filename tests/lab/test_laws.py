"""Force laws that MJCF has no words for: silent in plain MuJoCo, acting in the lab, and leaving no trace behind."""

import mujoco
import numpy as np
import pytest

from lab import laws
from lab.rig import Rig
from tests.lab import structures


def sprung(law: str) -> Rig:
    rig = Rig.from_xml(structures.oscillator())
    spring = rig.spring("x")
    return (
        laws.with_hysteresis(rig, spring, 30.0, 0.02)
        if law == "hysteresis"
        else laws.with_drift(rig, spring, 25.0)
    )


@pytest.mark.parametrize("law", ["hysteresis", "drift"])
def test_a_law_is_no_channel(law):
    rig, plain = sprung(law), Rig.from_xml(structures.oscillator())
    assert rig.inputs == plain.inputs
    assert rig.outputs == plain.outputs
    assert [spring.name for spring in rig.springs] == ["x"]


@pytest.mark.parametrize("law", ["hysteresis", "drift"])
def test_silent_until_acting(law):
    rig = sprung(law)
    model, data = rig.model, mujoco.MjData(rig.model)
    laws.set_duration(model, 10.0)
    data.qpos[0], data.time = 0.1, 5.0
    if model.na:
        data.act[0] = 0.3
    mujoco.mj_forward(model, data)
    silent = float(data.qfrc_actuator[0])
    with laws.acting(model):
        mujoco.mj_forward(model, data)
        # Halfway through the record, the drift has grown to 12.5 N/m; the hysteretic force is its activation.
        assert data.qfrc_actuator[0] == pytest.approx(-0.3 if law == "hysteresis" else -12.5 * 0.1, rel=1e-14)
    # Plain MuJoCo keeps the activation of a user actuator as it is, which the lab starts at zero.
    assert silent == (-0.3 if law == "hysteresis" else 0.0)
    mujoco.mj_forward(model, data)
    assert float(data.qfrc_actuator[0]) == silent


def test_the_force_levels_off_at_yield():
    rig = sprung("hysteresis")
    model, data = rig.model, mujoco.MjData(rig.model)
    data.qvel[0] = 0.7
    for z, rate in ((0.0, 30 * 0.7), (0.3, 30 * 0.7 * (1 - 0.3 / 0.6)), (0.6, 0.0)):
        data.act[0] = z
        with laws.acting(model):
            mujoco.mj_forward(model, data)
        # A x_y is 0.6 N; on the way there the rate falls in proportion to what is left.
        assert data.act_dot[0] == pytest.approx(rate, abs=1e-12)


def test_callbacks_of_others_come_back():
    def own(model, data, actuator):
        return 7.0

    rig = sprung("hysteresis")
    mujoco.set_mjcb_act_dyn(own)
    try:
        with pytest.raises(RuntimeError, match="stop"), laws.acting(rig.model):
            raise RuntimeError("stop")
        data = mujoco.MjData(rig.model)
        mujoco.mj_forward(rig.model, data)
        assert data.act_dot[0] == 7.0
    finally:
        mujoco.set_mjcb_act_dyn(None)


def test_no_law_no_callback():
    rig = Rig.from_xml(structures.oscillator())
    with laws.acting(rig.model):
        assert mujoco.get_mjcb_act_dyn() is None


def test_duration_reaches_drifting_springs_only():
    rig = laws.with_drift(sprung("hysteresis"), sprung("hysteresis").spring("x"), 3.0)
    before = np.array(rig.model.actuator_biasprm)
    laws.set_duration(rig.model, 4.0)
    after = np.array(rig.model.actuator_biasprm)
    drifting = [rig.model.actuator(i).name.startswith("drift@") for i in range(rig.model.nu)]
    assert list(after[:, 2] == 4.0) == drifting
    np.testing.assert_array_equal(after[:, :2], before[:, :2])
