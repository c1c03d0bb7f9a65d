"""Bending: springs that turn as they move are no cause, since the model has them; and what it lacks is still found."""

import numpy as np
import pytest

from lab.diagnosis.diagnose import diagnose
from lab.diagnosis.outcome import CONSISTENT, EXPLAINED
from lab.effects import EFFECTS
from lab.excitation import Random
from lab.instruments import instrument
from lab.rig import Rig
from lab.simulate import simulate

BARS = {"east": (1.0, 0.3), "north": (-0.2, 1.0), "west": (-0.7, -0.6)}
XML = f"""
<mujoco model="pin_on_three_bars">
  <option integrator="RK4" gravity="0 0 0" timestep="0.001"><flag contact="disable"/></option>
  <worldbody>
    {"".join(f'<site name="{name}" pos="{x} {y} 0"/>' for name, (x, y) in BARS.items())}
    <body name="pin">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
      <geom type="sphere" size="0.05" mass="1"/><site name="centre"/>
    </body>
  </worldbody>
  <tendon>
    {
    "".join(
        f'<spatial name="bar_{name}" stiffness="{k}" damping="2"><site site="{name}"/><site site="centre"/></spatial>'
        for name, k in zip(BARS, (900, 1400, 700), strict=True)
    )
}
  </tendon>
  <actuator><motor name="push" site="centre" gear="0.8 0.6 0 0 0 0"/></actuator>
  <sensor><accelerometer name="acc" site="centre"/></sensor>
</mujoco>
"""


@pytest.fixture(scope="module")
def rig():
    rig = Rig.from_xml(XML)
    return rig.connected(inputs=["push"], outputs=["acc.x", "acc.y"])


def measured(rig, seed=1):
    """Swings of a few hundredths of the bars' lengths, in half a percent of noise."""
    return simulate(
        instrument(rig, noise_percent=0.5), Random(rms=12.0), sample_rate=50.0, duration=60.0, seed=seed
    )


def test_a_true_model_that_bends_is_consistent(rig, monkeypatch):
    recording = measured(rig)
    diagnosis = diagnose(recording, rig)
    assert (diagnosis.verdict, diagnosis.findings) == (CONSISTENT, ())
    # 3000 samples know the level of the noise to a few percent.
    assert diagnosis.errors.calibrated == pytest.approx(0.005, rel=0.1)
    # Without it the same data are not what the twin says.
    monkeypatch.setattr("lab.diagnosis.diagnose.bent", lambda state, *_: state)
    assert diagnose(recording, rig, effects={"sensor_swap": EFFECTS["sensor_swap"]}).verdict != CONSISTENT


@pytest.mark.slow
def test_a_cause_beside_the_bending_is_found(rig):
    hidden = EFFECTS["cubic_stiffness"]("bar_west", k3=4e5)
    diagnosis = diagnose(measured(hidden.apply(rig), seed=2), rig)
    assert diagnosis.verdict == EXPLAINED
    (finding,) = diagnosis.findings
    assert (finding.effect.cause, finding.effect.location) == ("cubic_stiffness", "bar_west")
    k3 = finding.parameters["k3"]
    # Four standard deviations: one chance in ten thousand.
    assert abs(k3.value - 4e5) < 4 * k3.std


def test_a_straight_structure_has_none(rig):
    chain = Rig.load("models/chain3_coupled.xml")
    assert chain.straight
    assert not rig.straight
    assert np.all(rig.second_order().modes().frequency_hz < 25 / 2)
