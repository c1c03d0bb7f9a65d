"""Criteria of mode shapes against cases worked out by hand, and against their own invariances."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from identification.errors import IdentificationError
from identification.modes import (
    Modes,
    auto_mac,
    comac,
    cross_orthogonality,
    mac,
    mean_phase,
    mean_phase_deviation,
    modal_phase_collinearity,
    real_shapes,
)
from identification.recording import Channel
from tests import systems

components = st.complex_numbers(min_magnitude=1e-3, max_magnitude=1e3, allow_nan=False, allow_infinity=False)
some_shapes = arrays(complex, (5, 3), elements=components)
factors = arrays(complex, 3, elements=components)

# A few roundings of numbers between one thousandth and one thousand.
ROUNDING = 1e-9


def modes_of(shapes):
    shapes = np.asarray(shapes, dtype=complex)
    n_outputs, n_modes = shapes.shape
    outputs = tuple(Channel(f"y{i}", "m", f"x{i}") for i in range(n_outputs))
    return Modes(np.arange(1.0, n_modes + 1), np.full(n_modes, 0.01), shapes, outputs)


def test_no_modes_can_be_taken():
    none = modes_of(np.ones((5, 3))).take([])
    assert len(none) == 0
    assert none.shapes.shape == (5, 0)
    assert len(modes_of(np.ones((5, 3))).take([False, True, False])) == 1


# --- Alike or not


def test_mac_of_shapes_at_a_known_angle():
    angle = 0.3
    a, b = np.array([[1.0], [0.0]]), np.array([[np.cos(angle)], [np.sin(angle)]])
    assert mac(a, b) == pytest.approx(np.cos(angle) ** 2, rel=1e-15)


@given(some_shapes, factors)
def test_mac_ignores_scale_and_phase_and_stays_between_zero_and_one(shapes, scale):
    M = auto_mac(shapes)
    np.testing.assert_allclose(mac(shapes, shapes * scale), M, atol=ROUNDING)
    np.testing.assert_allclose(np.diag(M), 1, atol=ROUNDING)
    assert np.all((M >= 0) & (M <= 1 + ROUNDING))


def test_auto_mac_is_the_identity_where_the_mass_is_the_same_everywhere():
    # chain7 has the mass matrix I, so that its mode shapes are orthogonal.
    np.testing.assert_allclose(auto_mac(systems.chain7().modes().shapes), np.eye(7), atol=1e-12)


@given(some_shapes, factors)
def test_comac_is_one_for_the_same_modes_however_scaled(shapes, scale):
    np.testing.assert_allclose(comac(shapes, shapes * scale), 1, atol=ROUNDING)


def test_comac_points_at_the_sensor_that_is_wrong():
    shapes = systems.chain7().modes().shapes
    swapped = shapes[[0, 1, 3, 2, 4, 5, 6]]
    found = comac(shapes, swapped)
    assert set(np.argsort(found)[:2]) == {2, 3}
    # The other sensors agree but for the lengths of the shapes, which a swap does not change.
    np.testing.assert_allclose(found[[0, 1, 4, 5, 6]], 1, atol=1e-12)


def test_comac_by_hand():
    a = np.array([[1.0, 0.0], [0.0, 1.0]])
    b = np.array([[0.6, 0.8], [0.8, -0.6]])
    # Σ|a b| = 0.6, Σ|a|² = 1, Σ|b|² = 1 at both outputs.
    np.testing.assert_allclose(comac(a, b), [0.36, 0.36], rtol=1e-14)


def test_comac_of_an_output_that_never_moves_is_one():
    a = np.array([[1.0, 1.0], [0.0, 0.0]])
    np.testing.assert_array_equal(comac(a, a), [1.0, 1.0])
    np.testing.assert_array_equal(comac(a, np.array([[1.0, 1.0], [1.0, 0.0]]))[1], 0.0)


def test_cross_orthogonality_tells_modes_apart_that_the_mac_confuses():
    structure = systems.chain3()  # unequal masses; proportional damping, so the shapes are real
    shapes = structure.modes().shapes
    np.testing.assert_allclose(cross_orthogonality(shapes, shapes, structure.mass), np.eye(3), atol=1e-12)
    assert auto_mac(shapes)[0, 1] > 1e-3


@pytest.mark.parametrize("criterion", [mac, comac])
def test_different_outputs_are_refused(criterion):
    with pytest.raises(IdentificationError, match="3 and 2 outputs; expected the same outputs"):
        criterion(np.ones((3, 1)), np.ones((2, 1)))


def test_unpaired_modes_and_a_wrong_mass_matrix_are_refused():
    with pytest.raises(IdentificationError, match="1 and 2 modes; expected pairs"):
        comac(np.ones((3, 1)), np.ones((3, 2)))
    with pytest.raises(IdentificationError, match=r"3 degrees of freedom and the mass matrix is \(2, 2\)"):
        cross_orthogonality(np.ones((3, 1)), np.ones((3, 1)), np.eye(2))


# --- Complex or not


@given(arrays(float, 5, elements=st.floats(0.01, 100)), st.floats(-1.5, 1.5))
def test_a_turned_real_shape_has_its_turn_as_mean_phase(shape, angle):
    turned = (shape * np.exp(1j * angle))[:, None]
    assert mean_phase(turned)[0] == pytest.approx(angle, abs=1e-12)
    assert mean_phase_deviation(turned)[0] == pytest.approx(0, abs=1e-12)
    assert modal_phase_collinearity(turned)[0] == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(real_shapes(turned)[:, 0], shape, rtol=1e-12)


@given(some_shapes, st.floats(-3, 3))
def test_complexity_ignores_a_turn_of_the_whole_shape(shapes, angle):
    turned = shapes * np.exp(1j * angle)
    collinearity = modal_phase_collinearity(shapes)
    np.testing.assert_allclose(modal_phase_collinearity(turned), collinearity, atol=ROUNDING)
    # A shape without a direction has no mean phase either, and its deviation follows whatever is taken.
    directed = collinearity > 1e-3
    deviation = [mean_phase_deviation(x)[directed] for x in (shapes, turned)]
    np.testing.assert_allclose(deviation[1], deviation[0], atol=1e-6)


def test_mean_phase_is_that_of_the_singular_vector():
    rng = np.random.default_rng(3)
    shape = rng.standard_normal((6, 1)) + 0.4j * rng.standard_normal((6, 1))
    V = np.linalg.svd(np.hstack([shape.real, shape.imag]))[2][0]  # Reynders et al. (2012), eq. (9)
    assert mean_phase(shape)[0] == pytest.approx(np.arctan(V[1] / V[0]), abs=1e-14)
    size = np.abs(shape[:, 0])
    angle = np.arccos(np.abs(shape[:, 0].real * V[0] + shape[:, 0].imag * V[1]) / size)
    assert mean_phase_deviation(shape)[0] == pytest.approx(np.sum(size * angle) / size.sum(), abs=1e-12)


def test_components_all_around_the_circle_have_no_phase():
    around = np.exp(2j * np.pi * np.arange(8) / 8)[:, None]
    assert modal_phase_collinearity(around)[0] == pytest.approx(0, abs=1e-15)
    # Angles to any line at d from the nearest: d, 45 - d, 45 + d and 90 - d degrees, whose mean is 45.
    assert mean_phase_deviation(around)[0] == pytest.approx(np.pi / 4, rel=1e-12)


def test_real_shapes_are_those_of_the_undamped_structure():
    structure = systems.chain3("coupled")
    found = real_shapes(structure.modes().shapes)
    undamped = type(structure)(structure.mass, 1e-9 * structure.mass, structure.stiffness, structure.dofs)
    # Non-proportional damping of 10 % turns the shapes by about as much, which counts squared.
    assert np.all(np.diag(mac(found, undamped.modes().shapes)) > 0.99)


# --- Scaling


@given(some_shapes)
def test_normalizations_change_the_scale_alone(shapes):
    modes = modes_of(shapes)
    largest, unit = modes.normalized(), modes.unit_length()
    np.testing.assert_allclose(np.max(np.abs(largest.shapes), axis=0), 1, atol=ROUNDING)
    np.testing.assert_allclose(np.linalg.norm(unit.shapes, axis=0), 1, atol=ROUNDING)
    for other in (largest, unit):
        np.testing.assert_allclose(np.diag(mac(other.shapes, modes.shapes)), 1, atol=ROUNDING)
        np.testing.assert_array_equal(other.frequency_hz, modes.frequency_hz)


def test_scaling_keeps_the_standard_deviations():
    modes = modes_of(np.ones((2, 1)))
    known = Modes(modes.frequency_hz, modes.damping_ratio, modes.shapes, modes.outputs, [0.1], [0.01])
    assert known.scaled([2j]).frequency_std == [0.1]
    np.testing.assert_array_equal(known.scaled([2j]).shapes, [[2j], [2j]])


def test_a_shape_without_motion_stays_zero():
    modes = modes_of(np.zeros((2, 1)))
    np.testing.assert_array_equal(modes.normalized().shapes, 0)
    np.testing.assert_array_equal(modes.unit_length().shapes, 0)
    assert mac(modes.shapes, modes.shapes) == 0
    assert mean_phase_deviation(modes.shapes) == 0
