"""Target "diagnosis": chances of confusion against drawn data, and what no layout can tell apart."""

from itertools import combinations

import numpy as np
import pytest

from lab.errors import LabError, UnknownNameError
from lab.placement import diagnosis_search
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
    found, std = arena, arena.noise_std
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
    found = arena
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
    assert quiet.n_layouts == 3 * 3
    assert quiet.figure == quiet.figures[0]


def test_actuators_are_those_with_which_causes_are_mistaken_least():
    rig, own = row_of_masses(3), plan(noise=5.0)
    best = place(rig, 2, n_actuators=1, target="diagnosis", plan=own, size=0.05, causes=CAUSES)
    everything = arena_of(rig, own, 0.05, CAUSES, n_acting=1)
    figures = {}
    for acting in range(3):
        arena = everything.under(rig, own, [acting])
        for channels in combinations(range(3), 2):
            # The mean of the likeliest confusions, written out.
            P = np.array([c for c in arena.confusions(channels)[1] if np.isfinite(c)])
            figures[channels, acting] = np.sum(P) / len(P)
    channels, acting = min(figures, key=figures.get)
    assert (best.sensors, best.actuators) == (tuple(f"a{i + 1}.x" for i in channels), (f"f{acting + 1}",))
    # Sums of the same numbers in another order.
    np.testing.assert_allclose(best.figures, sorted(figures.values()), rtol=1e-9)
    rows = {row.name: row for row in best.ranking}
    assert rows["worst"].figure == pytest.approx(max(figures.values()), rel=1e-9)
    assert rows["best"].details["any"] < rows["worst"].details["any"]


def test_of_too_many_sets_of_actuators_the_likeliest_are_compared_and_that_is_told(monkeypatch):
    rig, own = row_of_masses(4), plan(noise=5.0)
    causes = ("cubic_stiffness", "coulomb_friction")
    every = place(rig, 2, n_actuators=1, target="diagnosis", plan=own, causes=causes)
    monkeypatch.setattr(diagnosis_search, "MAX_SETS", 2)
    some = place(rig, 2, n_actuators=1, target="diagnosis", plan=own, causes=causes)
    assert (every.proven, some.proven, some.floor) == (True, False, None)
    assert every.figure <= some.figure
    assert any("of 4 sets of actuators 2 were compared" in warning for warning in some.warnings)


def test_causes_in_actuators_that_rest_are_no_suspects():
    rig, own = row_of_masses(3), plan()
    arena = arena_of(rig, own, 0.05, CAUSES).under(rig, own, [0])
    _, confused, _ = arena.confusions([0, 1, 2])
    known = {key: value for key, value in zip(arena.keys, confused, strict=True) if key[0] == "actuator_gain"}
    assert np.isfinite(known["actuator_gain", "f1"])
    assert np.isnan(known["actuator_gain", "f2"])


def test_any_wrong_cause_is_named_at_least_as_often_as_the_likeliest(arena):
    channels = [0, 1, 2]
    _, confused, _ = arena.confusions(channels)
    wrong = arena.mistakes(channels)
    np.testing.assert_array_equal(np.isnan(wrong), np.isnan(confused))
    # Four standard deviations of a count of 2000.
    slack = 4 * np.sqrt(confused * (1 - confused) / 2000)
    assert np.all((wrong >= confused - slack)[np.isfinite(wrong)])


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
