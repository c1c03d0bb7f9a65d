"""Shapes as displacements against the eigenvectors of known structures."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.modes import Modes, mac
from identification.recording import Channel
from lab.shapes import aligned, displacement_shapes, dof_shapes
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
