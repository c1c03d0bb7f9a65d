"""A structure of one's own, with names of one's own, goes through the lab without touching code."""

import json

import numpy as np
import pytest

from lab.cli import main

GANTRY = """
<mujoco model="gantry">
  <option integrator="RK4" gravity="0 0 0" timestep="0.001"><flag contact="disable"/></option>
  <worldbody>
    <body name="trolley">
      <joint name="travel" type="slide" axis="0 1 0" stiffness="300" damping="1.5"/>
      <geom type="box" size="0.1 0.1 0.1" mass="3"/>
      <site name="cup"/>
    </body>
    <body name="hook" pos="0 1 0">
      <joint name="heave" type="slide" axis="0 1 0" damping="0.4"/>
      <geom type="box" size="0.1 0.1 0.1" mass="1.5"/>
    </body>
  </worldbody>
  <tendon>
    <fixed name="cable" stiffness="120" damping="0.5" springlength="0">
      <joint joint="travel" coef="-1"/><joint joint="heave" coef="1"/>
    </fixed>
  </tendon>
  <actuator><motor name="winch" joint="heave"/><motor name="drive" joint="travel"/></actuator>
  <sensor><accelerometer name="pickup" site="cup"/><jointvel name="speed" joint="heave"/></sensor>
</mujoco>
"""

TEST = """
title = "Gantry"
model = "gantry.xml"
[test]
sample_rate = 40
duration = 20
accuracy = 1e-11
[excitation]
kind = "pulse"
[channels]
outputs = ["pickup.y", "speed"]
[identification]
method = "era"
order = 4
"""

MASS = np.diag([3.0, 1.5])
DAMPING = np.array([[1.5 + 0.5, -0.5], [-0.5, 0.5 + 0.4]])
STIFFNESS = np.array([[300.0 + 120.0, -120.0], [-120.0, 120.0]])


@pytest.fixture
def tested(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gantry.xml").write_text(GANTRY)
    (tmp_path / "test.toml").write_text(TEST)
    return call("run", "test.toml", "--out", "out", "--quiet") or tmp_path / "out"


def call(*arguments):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 0


def test_its_matrices_come_out(tested):
    document = json.loads((tested / "result.json").read_text("utf-8"))
    found = document["second_order"]
    order = [found["dofs"].index(name) for name in ("travel", "heave")]
    for name, matrix in (("mass", MASS), ("damping", DAMPING), ("stiffness", STIFFNESS)):
        estimate = np.array(found[name])[np.ix_(order, order)]
        # The response is accurate to 1e-11; recovery of M, C, K costs two to three digits at most.
        np.testing.assert_allclose(estimate, matrix, rtol=0, atol=1e-8 * matrix.max())


def test_its_recording_stands_for_itself(tested):
    call("identify", "out/recording.h5", "--out", "again", "--quiet")
    found = json.loads((tested.parent / "again/result.json").read_text("utf-8"))["modes"]
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(MASS, X) for X in (STIFFNESS, DAMPING)]])
    expected = np.unique(np.abs(np.linalg.eigvals(A)).round(9)) / (2 * np.pi)
    # The response is accurate to 1e-11 and the poles that are well seen in it to about as much.
    assert [mode["frequency_hz"] for mode in found] == pytest.approx(expected, rel=1e-8)
