"""Target "modes": a cantilever of masses by hand and by brute force, blocks, roving sensors and loading."""

from itertools import combinations

import numpy as np
import pytest

from lab.errors import LabError, UnknownNameError
from lab.placement.loading import added_mass, frequency_shifts
from lab.placement.place import place
from lab.placement.shapes import normal_modes
from lab.rig import Rig
from tests.lab.placement.structures import row_of_masses


def analytic_shapes(n, mass):
    """Modes of unit modal mass of a row of equal masses, fixed at one end, free at the other: a sine at odd quarters."""
    odd = 2 * np.arange(1, n + 1) - 1
    Phi = np.sin(np.outer(np.arange(1, n + 1), odd) * np.pi / (2 * n + 1))
    return Phi / np.sqrt(mass * np.sum(Phi**2, axis=0))


def test_one_sensor_for_the_first_mode_goes_to_the_tip():
    # The first mode is largest at the free end.
    placement = place(row_of_masses(5), 1, n_actuators=1)
    assert placement.sensors == ("a5.x",)
    assert placement.actuators == ("f5",)
    # One unit of noise over the mode's amplitude there.
    assert placement.figure == pytest.approx(1 / abs(analytic_shapes(5, 2.0)[4, 0]), rel=1e-9)


@pytest.mark.parametrize("criterion", ["d", "a", "e", "mac"])
def test_proven_best_is_the_best_of_all(criterion):
    Phi = analytic_shapes(7, 2.0)[:, :3]
    figures = {}
    for rows in combinations(range(7), 4):
        G = Phi[list(rows)].T @ Phi[list(rows)]
        values = np.linalg.eigvalsh(G)
        size = np.sqrt(np.diag(G))
        mac = (G / size / size[:, None]) ** 2 - np.eye(3)
        figures[rows] = {
            "d": np.prod(values) ** (-1 / 6),
            "a": np.sqrt(np.mean(1 / values)),
            "e": values[0] ** -0.5,
            "mac": np.max(mac),
        }[criterion]
    best = min(figures, key=figures.get)
    placement = place(row_of_masses(7), 4, n_modes=3, criterion=criterion)
    assert placement.proven
    assert placement.n_layouts == 35
    assert placement.sensors == tuple(f"a{i + 1}.x" for i in best)
    # Eigenvectors of a 7 x 7 matrix, squared for MAC.
    assert placement.figure == pytest.approx(figures[best], rel=1e-9)
    np.testing.assert_allclose(placement.figures, sorted(figures.values()), rtol=1e-8, atol=1e-13)


def test_search_reports_a_floor_that_the_proven_best_respects():
    rig = row_of_masses(9)
    proven, searched = (place(rig, 4, n_modes=3, limit=limit) for limit in (10**6, 0))
    assert not searched.proven
    assert searched.floor <= proven.figure * (1 + 1e-9)
    assert proven.figure <= searched.figure * (1 + 1e-9)
    # Relaxed layouts of nine places are a few percent better than whole ones.
    assert searched.floor > 0.8 * searched.figure


def test_equal_quantities_need_no_noise_and_different_ones_do():
    rig = Rig.load("models/truss.xml")
    rig = rig.connected(outputs=rig.responding)
    with pytest.raises(LabError, match="give the noise of each"):
        place(rig, 4)
    noise = {"m/s^2": 1.0, "m": 1e-9}
    # Displacements a billion times less noisy than accelerations win at a few rad/s.
    assert all(name.startswith("pos") for name in place(rig, 4, n_modes=4, noise=noise).sensors)


def test_triaxial_sensors_are_chosen_whole():
    rig = Rig.load("models/truss.xml")
    rig = rig.connected(outputs=rig.responding)
    placement = place(rig, 2, quantity="acceleration", triaxial=True, n_modes=4)
    assert set(placement.sensors) <= {"acc1", "acc2", "acc3", "acc4"}
    assert len(placement.sensors) == 2
    assert placement.n_layouts == 6


def test_roving_sensors_share_references():
    placement = place(row_of_masses(9), 4, n_modes=3, setups=3, references=2)
    first = placement.setups[0][:2]
    assert all(setup[:2] == first and len(setup) == 4 for setup in placement.setups)
    rovers = [name for setup in placement.setups for name in setup[2:]]
    assert len(set(rovers)) == 6
    assert set(placement.sensors) == {*first, *rovers}


def test_references_see_the_faintest_mode_best():
    Phi = analytic_shapes(9, 2.0)[:, :3]
    best = max(combinations(range(9), 2), key=lambda rows: np.min(np.sum(Phi[list(rows)] ** 2, axis=0)))
    placement = place(row_of_masses(9), 4, n_modes=3, setups=2, references=2)
    assert set(placement.setups[0][:2]) == {f"a{i + 1}.x" for i in best}


def test_mass_of_a_sensor_on_one_mass_by_hand():
    rig = row_of_masses(1)
    placement = place(rig, 1, sensor_mass=0.1)
    # ω ∝ 1 / √m with 2 kg and 2.1 kg.
    assert placement.frequency_shifts[0] == pytest.approx(np.sqrt(2.0 / 2.1) - 1, rel=1e-9)
    assert "lower the frequency of mode 1" in placement.warnings[0]


def test_small_masses_shift_frequencies_as_first_order_theory_has_it():
    rig = row_of_masses(6)
    s = rig.second_order()
    _, Phi = normal_modes(rig)
    added = added_mass(rig, ["a2.x", "a5.x"], 1e-6)
    first = -0.5 * 1e-6 * (Phi[1] ** 2 + Phi[4] ** 2)
    # The second order is a millionth of the first.
    np.testing.assert_allclose(frequency_shifts(s.mass, s.stiffness, Phi, added), first, rtol=1e-4)


def test_actuators_drive_the_faintest_mode_most():
    rig = row_of_masses(6)
    Phi = analytic_shapes(6, 2.0)[:, :3]
    share = Phi**2 / np.sum(Phi**2, axis=0)
    best = max(combinations(range(6), 2), key=lambda rows: np.min(np.sum(share[list(rows)], axis=0)))
    assert place(rig, 3, n_actuators=2).actuators == tuple(f"f{i + 1}" for i in best)


def test_planned_layout_is_ranked():
    placement = place(row_of_masses(5), 2, n_modes=2, planned=(["a1.x", "a2.x"], []))
    (row,) = [row for row in placement.ranking if row.name == "planned"]
    assert row.figure == placement.figures[row.rank - 1]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"n_sensors": 9}, "9 sensors asked for, of 5 candidates"),
        ({"n_sensors": 2, "n_modes": 3}, "3 modes asked for"),
        ({"n_sensors": 2, "criterion": "b"}, "expected d, a, e or mac"),
        ({"n_sensors": 2, "target": "all"}, "expected modes, matrices, diagnosis"),
        ({"n_sensors": 2, "fixed": ["a1.x"], "forbid": ["a1*"]}, "both fixed and forbidden"),
        ({"n_sensors": 2, "setups": 2}, "0 of 2 sensors are references"),
        ({"n_sensors": 2, "references": 1}, "references only where there are several set-ups"),
        ({"n_sensors": 2, "sensor_mass": -1.0}, "expected a positive number"),
        ({"n_sensors": 2, "quantity": "force"}, "expected one of displacement"),
        ({"n_sensors": 2, "planned": (["b7"], [])}, "'b7', which is no candidate"),
    ],
)
def test_mistakes_are_told(settings, message):
    with pytest.raises(LabError, match=message):
        place(row_of_masses(5), **settings)


def test_names_that_do_not_exist_are_told_with_those_that_do():
    with pytest.raises(UnknownNameError, match=r"'a9' is neither .* there are a1.x"):
        place(row_of_masses(2), 1, fixed=["a9"])
