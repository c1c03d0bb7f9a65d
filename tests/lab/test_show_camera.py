"""The eye sees every point, and is no farther away than that takes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.show.camera import FIELD_OF_VIEW, VIEW_FROM, eye


def picture(points, position, target):
    """Places of points in a picture whose height is 2: x to the right, y upwards, by an independent projection."""
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(right, forward), forward])
    x, y, depth = frame @ (points - position).T
    return np.stack([x, y]) / depth / np.tan(FIELD_OF_VIEW / 2), depth


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), aspect=st.floats(0.4, 4.0), stretch=st.floats(0.01, 30.0))
def test_all_points_are_in_the_picture_and_fill_it(seed, aspect, stretch):
    points = np.random.default_rng(seed).standard_normal((12, 3)) * [stretch, 1.0, 1.0]
    position, target = eye(points, aspect=aspect, margin=0.0)
    (x, y), depth = picture(points, position, target)
    assert np.all(depth > 0)
    assert np.max(np.abs(x)) <= aspect * (1 + 1e-9)
    assert np.max(np.abs(y)) <= 1 + 1e-9
    # Nearer would lose a point.
    assert max(np.max(np.abs(x)) / aspect, np.max(np.abs(y))) > 1 - 1e-9


def test_left_and_right_are_equally_far_from_the_edge():
    """A long row of points seen aslant: the near end looks larger, yet neither end is favoured."""
    points = np.stack([np.linspace(-10, 10, 21), np.zeros(21), np.zeros(21)], axis=1)
    (x, _), _ = picture(points, *eye(points, aspect=2.4, margin=0.0))
    np.testing.assert_allclose(-np.min(x), np.max(x), rtol=1e-3)  # the search ends at a thousandth
    np.testing.assert_allclose(np.linalg.norm(VIEW_FROM), 1.0)


def test_a_single_point_needs_a_margin():
    position, target = eye(np.zeros((1, 3)), aspect=1.0, margin=0.5)
    np.testing.assert_allclose(target, 0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(position), 0.5 / np.tan(FIELD_OF_VIEW / 2))
