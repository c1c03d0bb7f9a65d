"""Where causes sit on a moving structure: the places follow the bodies that they belong to."""

import mujoco
import numpy as np
import pytest

from lab.show.places import arcs, places
from lab.show.springs import kinematics
from lab.show.structure import moving_bodies
from tests.lab.diagnosed import two_masses
from tests.lab.showcase import chain_rig

Q = 0.01 * np.random.default_rng(0).standard_normal((2, 5))


def centers(rig, body, q):
    """Centre of mass of a body through a motion, frame by frame."""
    index = moving_bodies(rig)[rig.bodies.index(body)]
    return np.stack([kinematics(rig, each, mujoco.MjData(rig.model)).xipos[index] for each in q.T])


@pytest.mark.parametrize(
    ("location", "bodies"),
    [
        ("mass1", ["mass1"]),
        ("q1", ["mass1"]),  # a joint that is no spring
        ("spring0_1", ["mass0", "mass1"]),
        ("mass0|mass1", ["mass0", "mass1"]),
        ("world|mass1", ["mass1"]),
        ("pos1", ["mass1"]),
        ("force0", ["mass0"]),
        ("acc0.x|pos1", ["mass0", "mass1"]),
        ("*", []),
        ("nowhere", []),
    ],
)
def test_a_place_moves_with_its_bodies(location, bodies):
    rig = two_masses()
    found = places(rig, location, Q)
    assert found.shape == (5, len(bodies), 3)
    for k, body in enumerate(bodies):
        np.testing.assert_allclose(found[:, k], centers(rig, body, Q), rtol=0, atol=1e-12)


def test_every_spring_channel_and_body_of_a_model_has_a_place():
    rig = chain_rig("chain3_coupled")
    q = np.zeros((3, 1))
    for spring in rig.springs:
        assert places(rig, spring.name, q).shape[1] == 2
    for name in (*rig.bodies, *(c.name for c in (*rig.inputs, *rig.outputs))):
        assert places(rig, name, q).shape[1] == 1


def test_an_arc_runs_from_end_to_end_and_upwards():
    ends = np.array([[[0.0, 0.0, 0.0], [2.0, 0.0, 1.0]]])
    (arc,) = arcs(ends, 0.5)
    np.testing.assert_allclose(arc[[0, -1]], ends[0], atol=1e-15)
    np.testing.assert_allclose(arc[8], [1.0, 0.0, 0.5 + 0.5], atol=1e-15)
