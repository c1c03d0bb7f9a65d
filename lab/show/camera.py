"""Where to look from: an eye that sees all points in a window of given shape, left and right edge alike."""

from __future__ import annotations

import numpy as np

FIELD_OF_VIEW = np.radians(55)
"""Top to bottom."""
VIEW_FROM = np.array([0.25, -0.85, 0.45]) / np.linalg.norm([0.25, -0.85, 0.45])
"""From the front, a little from above."""
N_ROUNDS = 30


def eye(points: np.ndarray, *, aspect: float, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and target of an eye as near as it can be, shapes (3,) [m].

    Args:
        points: to be seen, shape (n, 3) [m].
        aspect: width of the window over its height.
        margin: room around the points [m].
    """
    right = np.cross(-VIEW_FROM, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, -VIEW_FROM)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    x, y, near = ((points - middle) @ axis for axis in (right, up, VIEW_FROM))
    tangent = np.tan(FIELD_OF_VIEW / 2)
    shift, lift, distance = 0.0, 0.0, 0.0
    # What is near looks larger, so the eye moves until both edges are equally far.
    for _ in range(N_ROUNDS):
        across = (np.abs(x - shift) + margin) / (tangent * aspect)
        upward = (np.abs(y - lift) + margin) / tangent
        distance = float(np.max(near + np.maximum(across, upward)))
        shift += 0.5 * _imbalance((x - shift) / (distance - near)) * distance
        lift += 0.5 * _imbalance((y - lift) / (distance - near)) * distance
    across = (np.abs(x - shift) + margin) / (tangent * aspect)
    upward = (np.abs(y - lift) + margin) / tangent
    distance = float(np.max(near + np.maximum(across, upward)))
    target = middle + shift * right + lift * up
    return target + distance * VIEW_FROM, target


def _imbalance(slope: np.ndarray) -> float:
    """How much farther from the middle of the picture one edge is than the other."""
    return float(np.max(slope) + np.min(slope)) / 2
