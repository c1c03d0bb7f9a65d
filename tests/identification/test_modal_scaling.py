"""Modal mass and scaled shapes against the mass matrix that the structure was built with."""

from dataclasses import replace

import numpy as np
import pytest

from identification.errors import NotSecondOrderError
from identification.modal_scaling import modal_scaling
from identification.modes import mac
from identification.recording import Channel
from identification.second_order import scaled_eigenvectors
from tests import systems

QUANTITIES = ["displacement", "velocity", "acceleration"]


def rigged(structure, sensors, actuators, quantity="acceleration", **factors):
    return systems.instrumented(
        structure,
        systems.sensors(sensors, quantity, factor=factors.get("sensor", 1.0)),
        systems.actuators(actuators, factor=factors.get("actuator", 1.0)),
    )


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("dt", [0.0, 0.05])
def test_modal_mass_of_real_modes_is_that_of_the_mass_matrix(quantity, dt):
    structure = systems.chain3()
    system = rigged(structure, structure.dofs, ("x2",), quantity)
    found = modal_scaling(system.sampled(dt) if dt else system)
    phi = found.modes.shapes.real
    np.testing.assert_allclose(found.modes.shapes.imag, 0, atol=1e-12)  # damping is proportional to stiffness
    expected = np.diag(phi.T @ structure.mass @ phi)
    # Rounding of the eigenvectors, whose condition is below a hundred.
    np.testing.assert_allclose(found.modal_mass, expected, rtol=1e-11)
    unit = found.unit_modal_mass().shapes
    np.testing.assert_allclose(unit.T @ structure.mass @ unit, np.eye(3), atol=1e-11)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_unit_modal_a_is_the_scaling_of_the_paper(quantity):
    structure = systems.chain3("coupled")  # complex modes
    system = rigged(structure, structure.dofs, ("x1", "x3"), quantity).sampled(0.05)
    psi = modal_scaling(system).unit_modal_a().shapes
    paper = scaled_eigenvectors(system)
    expected = paper.psi[:, paper.poles.imag > 0]
    sign = np.sign(np.sum(psi * expected.conj(), axis=0).real)
    np.testing.assert_allclose(psi * sign, expected, atol=1e-11)


def test_the_frequency_response_is_the_sum_over_unit_modes():
    structure = systems.truss()
    system = rigged(structure, structure.dofs, structure.dofs, "displacement")
    psi_modes = modal_scaling(system).unit_modal_a()
    s = 2j * np.pi * 1.7
    H = sum(
        np.outer(psi, psi) / (s - pole) + np.outer(psi, psi).conj() / (s - pole.conjugate())
        for psi, pole in zip(psi_modes.shapes.T, psi_modes.poles, strict=True)
    )
    exact = np.linalg.inv(s**2 * structure.mass + s * structure.damping + structure.stiffness)
    np.testing.assert_allclose(H, exact, atol=1e-11 * np.abs(exact).max())


def test_factors_and_further_channels_leave_the_modal_mass():
    structure = systems.chain3()
    plain = modal_scaling(rigged(structure, structure.dofs, ("x2",)))
    mounted = rigged(structure, structure.dofs, ("x2",), sensor=-2.5, actuator=0.4)
    np.testing.assert_allclose(modal_scaling(mounted).modal_mass, plain.modal_mass, rtol=1e-11)
    two = rigged(structure, structure.dofs, ("x2", "x3"))
    np.testing.assert_allclose(modal_scaling(two).modal_mass, plain.modal_mass, rtol=1e-11)


def test_modes_need_not_be_complete():
    structure = systems.chain7()
    full = rigged(structure, ("x1", "x4", "x7"), ("x7",), "displacement")
    found = modal_scaling(full)
    assert found.modes.shapes.shape == (3, 7)
    truth = structure.modes().shapes[[0, 3, 6]]
    np.testing.assert_allclose(np.diag(mac(found.modes.shapes, truth)), 1, atol=1e-10)
    phi = structure.modes().shapes.real
    phi = phi / np.take_along_axis(phi[[0, 3, 6]], np.argmax(np.abs(phi[[0, 3, 6]]), axis=0)[None], axis=0)
    np.testing.assert_allclose(
        found.modal_mass.real, np.sum(phi**2, axis=0), rtol=1e-9
    )  # the mass matrix is I


def test_without_a_driving_point_there_is_no_scale():
    with pytest.raises(NotSecondOrderError, match="sensors are on x1 and actuators on x2"):
        modal_scaling(rigged(systems.chain3(), ("x1",), ("x2",)))


def test_a_mode_with_a_node_at_the_driving_point_is_named():
    # Two equal masses: the middle one of three is a node of the second mode.
    chain = systems.chain3()
    springs = 2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
    symmetric = type(chain)(np.eye(3), 0.01 * springs, springs, chain.dofs)
    with pytest.raises(NotSecondOrderError, match=r"mode at 0\.2251 Hz does not move x2"):
        modal_scaling(rigged(symmetric, chain.dofs, ("x2",)))


def test_channels_that_read_no_motion_are_left_aside():
    system = rigged(systems.chain3(), ("x1", "x2", "x3"), ("x1",))
    outputs = (Channel("gauge", "V", "x1"), *system.outputs[1:])
    with pytest.raises(NotSecondOrderError, match="sensors are on x2, x3 and actuators on x1"):
        modal_scaling(replace(system, outputs=outputs))
