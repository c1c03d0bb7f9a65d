"""Shapes for drawing against the eigenvectors of known structures."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.modes import Modes, mac
from identification.recording import Channel
from lab.show.shapes import aligned, displacement_shapes, dof_shapes, shape_table, shown_modes, within_reach
from tests.lab.showcase import chain_result, chain_rig

MIXED = ["pos1", "vel2", "acc3.x"]


def test_velocities_and_accelerations_become_displacements():
    """Three different sensors on three masses show the mode shape of displacement, damping and all."""
    rig = chain_rig("chain3_coupled", outputs=MIXED)
    rows, shapes = displacement_shapes(rig.modes())
    assert rows == [0, 1, 2]
    agreement = mac(shapes, rig.second_order().modes().shapes)
    np.testing.assert_allclose(np.diag(agreement), 1, atol=1e-12)  # rounding of two eigenvalue problems


def test_factors_are_taken_out_and_other_quantities_left_out():
    shapes = np.array([[2.0 + 0j], [3.0 + 0j], [5.0 + 0j]])
    outputs = (Channel("a", "m", "x", -2.0), Channel("b", "V"), Channel("c", "m", "z"))
    rows, drawn = displacement_shapes(Modes(np.array([1.0]), np.array([0.1]), shapes, outputs))
    assert rows == [0, 2]
    np.testing.assert_allclose(drawn[:, 0], [-1, 5])


@given(seed=st.integers(0, 1000), size=st.floats(1e-6, 1e6), angle=st.floats(0, 6.3))
def test_alignment_forgets_scale_and_phase(seed, size, angle):
    rng = np.random.default_rng(seed)
    shapes = rng.standard_normal((4, 2)) + 0.3j * rng.standard_normal((4, 2))
    reference, turned = aligned(shapes), aligned(size * np.exp(1j * angle) * shapes)
    np.testing.assert_allclose(turned, reference, atol=1e-9)
    assert np.abs(reference).max(axis=0) == pytest.approx(1)
    # No other turn has more in its real part.
    for other in np.linspace(0, np.pi, 50):
        power = np.sum(np.real(reference * np.exp(1j * other)) ** 2, axis=0)
        assert np.all(power <= np.sum(reference.real**2, axis=0) + 1e-12)


def test_recovered_matrices_tell_degrees_of_freedom_without_sensor():
    rig = chain_rig("chain3_coupled", outputs=["acc2.x", "acc3.x"])
    result = chain_result(rig, error=1e-13)
    shapes, known = dof_shapes(result, rig.dofs)
    assert known.all()
    np.testing.assert_allclose(shapes, aligned(rig.second_order().modes().shapes), atol=1e-9)
    shapes, known = dof_shapes(replace(result, second_order=None), rig.dofs)
    assert known.tolist() == [[False] * 3, [True] * 3, [True] * 3]
    assert np.all(shapes[0] == 0)


@pytest.mark.parametrize("recovered", [True, False])
def test_truth_lies_on_the_estimate_when_both_agree(recovered):
    rig = chain_rig("chain3_coupled", outputs=MIXED)
    result = chain_result(rig, error=1e-13)
    table = shape_table(result if recovered else replace(result, second_order=None))
    assert table.labels == (rig.dofs if recovered else tuple(MIXED))
    np.testing.assert_allclose(table.truth, table.estimate, atol=1e-9)  # 1e-13 through eigenvectors


def test_modes_without_partner_have_no_truth():
    result = chain_result(chain_rig("chain3_coupled", outputs=MIXED))
    table = shape_table(replace(result, comparison=None))
    assert np.isnan(table.truth).all()


def test_true_modes_far_above_the_identified_ones_are_left_out():
    truth = chain_rig("chain3_coupled", outputs=MIXED).modes()
    assert len(within_reach(truth, truth)) == 3
    assert len(within_reach(truth, truth.take([0]))) == 1
    assert len(within_reach(truth, truth.take([]))) == 3  # nothing to go by


def test_stable_modes_are_shown_before_others():
    result = replace(chain_result(chain_rig("chain3_coupled", outputs=MIXED)), stable=(False, True, True))
    assert shown_modes(result, 2) == [1, 2]
    assert shown_modes(result, 12) == [0, 1, 2]
