"""Drawn structures against geometry that is known: sites, rest lengths and plain kinematics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab.rig import Rig
from lab.show import springs, structure
from tests.lab.showcase import chain_rig

MIXED = """
<mujoco model="mixed">
  <option gravity="0 0 0"/>
  <worldbody>
    <geom type="plane" size="1 1 .1"/>
    <body name="cart" pos="1 0 0" euler="0 0 90">
      <joint name="x" type="slide" axis="0 1 0" stiffness="5"/>
      <geom type="box" size=".1 .2 .3" mass="1"/>
      <geom type="sphere" size=".1" mass="1" rgba="1 0 0 0.5"/>
      <body name="arm" pos="0 0 1">
        <joint name="turn" type="hinge" axis="0 1 0" stiffness="3"/>
        <geom type="capsule" fromto="0 0 0 0 0 1" size=".05" mass="1"/>
        <geom type="cylinder" size=".05 .2" mass="1"/>
        <body name="bob" pos="0 0 1">
          <joint name="slip" type="slide" axis="0 0 1" stiffness="2"/>
          <inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_bars_of_the_linear_truss_end_where_the_real_ones_do():
    """A fixed tendon has no ends of its own; the drawing must find the same as the spatial tendon's sites."""
    linear, spatial = chain_rig("truss"), chain_rig("truss_spatial")
    still = np.zeros((8, 1))
    ours, real = (structure.frames(rig, still).paths for rig in (linear, spatial))
    assert len(ours) == len(real) == 14
    for a, b in zip(ours, real, strict=True):
        ends_a, ends_b = (sorted(map(tuple, np.round(path[0][[0, -1]], 9) + 0.0)) for path in (a, b))
        assert ends_a == ends_b


def test_extension_is_how_much_longer_the_drawn_bar_got():
    rig = chain_rig("truss_spatial")
    position = 0.05 * np.random.default_rng(0).standard_normal((8, 5))
    frames = structure.frames(rig, position)
    rest = structure.frames(rig, np.zeros((8, 1))).paths
    for path, straight, extension in zip(frames.paths, rest, frames.extension, strict=True):
        lengths = np.linalg.norm(np.diff(path, axis=1), axis=2).sum(axis=1)
        before = np.linalg.norm(np.diff(straight, axis=1), axis=2).sum()
        np.testing.assert_allclose(lengths - before, extension, atol=1e-12)  # rounding of lengths near 1


def test_bodies_follow_their_coordinates():
    rig = chain_rig("chain3_coupled")
    position = np.random.default_rng(1).standard_normal((3, 4))
    frames = structure.frames(rig, position)
    at_rest = np.array([rig.model.body(name).pos for name in rig.bodies])
    expected = np.repeat(at_rest[:, None], 4, axis=1)
    expected[:, :, 0] += position
    np.testing.assert_allclose(frames.position, expected, atol=1e-15)
    np.testing.assert_allclose(frames.quaternion, np.broadcast_to([0, 0, 0, 1.0], (3, 4, 4)))
    np.testing.assert_allclose(frames.force_direction, np.broadcast_to([1.0, 0, 0], (3, 4, 3)))


def test_dampers_without_stiffness_are_not_drawn():
    rig = chain_rig("truss")
    names = [rig.springs[row].name for row in springs.drawn_springs(rig)]
    assert len(rig.springs) == 22
    assert all(name.startswith("bar") for name in names)


def test_solids_of_every_kind():
    rig = Rig.from_xml(MIXED)
    solids = structure.solids(rig)
    assert sorted(solid.kind for solid in solids) == ["box", "capsule", "cylinder", "ellipsoid", "ellipsoid"]
    ball = next(solid for solid in solids if solid.body == rig.model.body("bob").id)
    assert ball.kind == "ellipsoid"  # a body without geometry is still seen
    sphere = next(solid for solid in solids if solid.color[0] == 255)
    np.testing.assert_allclose(sphere.size, 0.1)
    np.testing.assert_array_equal(sphere.color, [255, 0, 0, 128])


def test_a_spring_on_a_moving_parent_moves_with_it():
    rig = Rig.from_xml(MIXED)
    frames = structure.frames(rig, np.array([[0.0, 0.3], [0.0, 0.0], [0.0, 0.0]]))
    slip = frames.paths[[s.name for s in rig.springs].index("slip")]
    # The cart is turned by 90 degrees, so its own y axis is minus x of the world.
    np.testing.assert_allclose(slip[1] - slip[0], [[-0.3, 0, 0]] * 2, atol=1e-12)
    assert len(springs.ground_ends(rig, 1.0)) == 1  # only the cart's spring reaches the ground


def test_a_torsion_spring_follows_its_joint():
    rig = Rig.from_xml(MIXED)
    frames = structure.frames(rig, np.array([[0.0, 0.0], [0.0, np.pi / 3], [0.0, 0.0]]))
    spiral = frames.paths[[s.name for s in rig.springs].index("turn")]
    center, axis = np.array([1.0, 0, 1]), np.array([-1.0, 0, 0])
    a, b = spiral[:, -1] - center
    assert np.cross(a, b) @ axis == pytest.approx(a @ a * np.sin(np.pi / 3), rel=1e-9)
    assert a @ b == pytest.approx(a @ a * np.cos(np.pi / 3), rel=1e-9)


@given(size=st.floats(1e-12, 1e6))
def test_magnification_is_round_and_shows_without_tearing(size):
    rig = chain_rig("chain3_coupled")
    factor = structure.magnification(rig, np.array([[size], [-size / 2], [0.0]]))
    assert float(f"{factor:.0e}") == factor
    assert f"{factor:e}"[0] in "125"
    reach = factor * size / structure.spacing(rig)
    assert 0.3 / 2.5 * (1 - 1e-9) <= reach <= 0.3 * (1 + 1e-9)  # the steps 1, 2, 5, 10 are at most 2.5 apart


def test_a_structure_at_rest_is_not_magnified():
    rig = chain_rig("chain3_coupled")
    assert structure.magnification(rig, np.zeros((3, 2))) == 1.0
