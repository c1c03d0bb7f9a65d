"""Signals compared for modes: the modal system is the structure, and a signal tells what its Fisher information says."""

import numpy as np
import pytest

from lab.placement import modal_drives as module
from lab.placement.modal_drives import modal_system
from lab.placement.place import place
from lab.placement.plan import Plan, driving
from lab.rig import Rig
from tests.lab.placement.structures import row_of_masses


def response(system, s):
    n = len(system.A)
    return system.C @ np.linalg.solve(s * np.eye(n) - system.A, system.B) + system.D


def test_with_all_modes_it_is_the_structure():
    rig = Rig.load("models/truss.xml")
    rig = rig.connected(outputs=rig.responding)
    outputs, inputs = [0, 3, 9], [1, 4]
    whole, modal = rig.state_space(), modal_system(rig, outputs, inputs, len(rig.dofs))
    for s in (0.3j, 1 + 5j):
        expected = response(whole, s)[np.ix_(outputs, inputs)]
        # Two linear systems of sixteen states, one of them through an eigenvalue problem.
        np.testing.assert_allclose(
            response(modal, s), expected, rtol=1e-8, atol=1e-12 * np.max(np.abs(expected))
        )


def test_lowest_modes_alone_answer_at_low_frequencies():
    rig = row_of_masses(6)
    system = modal_system(rig, [5], [5], 2)
    omega = rig.second_order().modes().frequency_hz[:2] * 2 * np.pi
    np.testing.assert_allclose(
        np.sort(np.abs(np.linalg.eigvals(system.A)))[::2], omega, rtol=1e-3
    )  # light damping


def test_one_mode_has_the_information_of_finite_differences():
    # One mass: frequency, damping, and the amplitude of its answer are unknown.
    rig, plan = (
        row_of_masses(1),
        Plan(driving("random", 2.0, band=(0.5, 8.0)), 40.0, 5.0, noise={"m/s^2": 0.05}),
    )
    placement = place(rig, 1, n_actuators=1, plan=plan, noise=plan.noise)
    ((_, u),) = plan.signals(rig)
    start = np.array(
        [20.0, 0.01, 1.0, 1.0]
    )  # ω0 = √(800 / 2), ζ = 0.8 / (2 · 2 · 20), real amplitude, direct gain

    def output(theta):
        omega, zeta, amplitude, direct = theta
        A = np.array([[0, 1], [-(omega**2), -2 * zeta * omega]])
        system = modal_system(rig, [0], [0], 1)
        C = amplitude * system.C[:, :2] * [[(omega / 20) ** 2, zeta * omega / 0.2]]
        changed = type(system)(A, system.B, C, direct * system.D, 0.0, system.inputs, system.outputs)
        return changed.sampled(1 / 40).simulate(u)[0]

    J = np.stack([(output(start + h) - output(start - h)) / 2e-5 for h in 1e-5 * np.eye(4)])
    # A complex mode has one more unknown, the phase of its answer, whose derivative is that of a mixed C.
    base = modal_system(rig, [0], [0], 1)
    mixed = type(base)(base.A, base.B, base.C @ base.A, 0 * base.D, 0.0, base.inputs, base.outputs)
    J = np.vstack([J, mixed.sampled(1 / 40).simulate(u)])
    std = 0.05 * np.sqrt(np.linalg.inv(J @ J.T)[0, 0])
    (drive,) = [d for d in placement.drives if d.excitation.endswith("times 1")]
    # Central differences at steps of 1e-5 leave about 1e-7 of the largest derivative.
    assert drive.figure == pytest.approx(std / 20.0, rel=1e-4)
    assert placement.drive_measure == module.MEASURE


def test_levels_divide_the_scatter_and_kinds_have_the_same_largest_force():
    rig = row_of_masses(3)
    placement = place(rig, 2, n_actuators=1, n_modes=2)
    found = {drive.excitation: drive for drive in placement.drives}
    base, strong = (found[f"random as planned, times {level}"] for level in (1, 10))
    # The same noise, forces ten times as large: a linear system.
    assert strong.figure == pytest.approx(base.figure / 10, rel=1e-9)
    for kind in ("random", "burst_random", "multisine", "sweep", "pulse"):
        assert found[kind].peak == pytest.approx(base.peak, rel=1e-12)


def test_without_actuators_or_with_too_many_unknowns_nothing_is_compared(monkeypatch):
    assert place(row_of_masses(3), 2).drives == ()
    monkeypatch.setattr(module, "MAX_PARAMETERS", 10)
    placement = place(row_of_masses(3), 2, n_actuators=1)
    assert (placement.drives, placement.drive_measure) == ((), "")
    assert any("signals are not compared" in warning for warning in placement.warnings)
