"""Target "diagnosis": chances of confusion against drawn data, and what no layout can tell apart."""

import numpy as np
import pytest

from lab.errors import LabError, UnknownNameError
from lab.placement.arena import arena_of
from lab.placement.place import place
from lab.placement.plan import Plan, driving
from tests.lab.placement.structures import row_of_masses

BAND = (0.5, 8.0)
CAUSES = ("cubic_stiffness", "coulomb_friction", "stiffness_change", "sensor_gain", "actuator_gain")


def plan(rms=10.0, noise=10.0):
    return Plan(driving("random", rms, band=BAND), 40.0, 10.0, noise_percent=noise)


@pytest.fixture(scope="module")
def arena():
    return arena_of(row_of_masses(3).connected(inputs=["f1", "f3"]), plan(), 0.05, CAUSES)


def test_causes_are_confused_as_often_as_in_drawn_data(arena):
    found, std = arena
    channels, n = [0, 2], 4000
    rng = np.random.default_rng(1)
    J, effects = found.suspects.slopes, found.suspects.effects * found.sizes[:, None, None]
    J, effects = ((x[:, channels] / std[channels][:, None]).reshape(len(x), -1) for x in (J, effects))
    # The metric is written out densely, as it would be for data.
    W = np.linalg.inv(np.eye(J.shape[1]) + J.T @ np.linalg.inv(found.suspects.precision) @ J)
    visible, confused, rival = found.confusions(channels)
    cause = int(np.nanargmax(np.where(confused < 0.3, confused, np.nan)))
    mine = int(np.flatnonzero(found.of_key == cause)[0])
    other = int(np.flatnonzero(found.of_key == rival[cause])[0])
    data = effects[mine] + rng.standard_normal((n, J.shape[1])) + rng.standard_normal((n, len(J))) @ J
    a, b = (x / np.sqrt(x @ W @ x) for x in (effects[mine], effects[other]))
    wrong = np.mean(np.abs(data @ W @ b) > np.abs(data @ W @ a))
    assert visible[cause] > 0
    # Four standard deviations of a count.
    assert wrong == pytest.approx(confused[cause], abs=4 * np.sqrt(confused[cause] / n))


def test_causes_in_channels_that_are_not_connected_are_no_suspects(arena):
    found, _ = arena
    _, confused, _ = found.confusions([0, 2])
    missing = found.keys.index(("sensor_gain", "a2.x"))
    assert np.isnan(confused[missing])
    assert np.isfinite(confused[found.keys.index(("sensor_gain", "a1.x"))])


def test_less_noise_makes_less_confusion():
    rig = row_of_masses(3)
    quiet, loud = (
        place(rig, 2, n_actuators=1, target="diagnosis", plan=plan(noise=noise), size=0.05, causes=CAUSES)
        for noise in (2.0, 20.0)
    )
    assert quiet.figure < loud.figure
    assert quiet.proven
    assert quiet.n_layouts == 3
    assert quiet.figure == quiet.figures[0]


def test_nonlinear_causes_show_at_high_levels_and_linear_ones_need_none():
    placement = place(row_of_masses(2), 1, n_actuators=1, target="diagnosis", plan=plan(), causes=CAUSES)
    times = {d.excitation.rpartition("times ")[2]: d for d in placement.drives if "times" in d.excitation}
    assert times["10"].peak == pytest.approx(10 * times["1"].peak)
    assert times["1"].figure == pytest.approx(placement.figure, rel=1e-9)  # the planned test again
    assert times["0.1"].figure > placement.figure


def test_a_joint_spring_and_a_tendon_along_it_are_told_apart_by_no_layout():
    rig = row_of_masses(2).edited(lambda root: root.find(".//joint[@name='x1']").set("stiffness", "300"))
    placement = place(rig, 2, n_actuators=1, target="diagnosis", plan=plan(), causes=("cubic_stiffness",))
    assert ("cubic_stiffness at x1", "cubic_stiffness at k1") in placement.inseparable


def test_mistakes_are_told():
    rig = row_of_masses(2)
    with pytest.raises(UnknownNameError, match="cause 'rust' does not exist"):
        place(rig, 1, n_actuators=1, target="diagnosis", plan=plan(), causes=("rust",))
    with pytest.raises(LabError, match="expected a positive share"):
        place(rig, 1, n_actuators=1, target="diagnosis", plan=plan(), size=0.0)
    with pytest.raises(LabError, match="no number of actuators"):
        place(rig, 1, target="diagnosis", plan=plan())
