"""Where a cause sits on the moving structure."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from lab.rig import Rig
from lab.show.springs import anchor, kinematics, path
from lab.show.structure import moving_bodies, spacing

Points = Callable[[mujoco.MjData, np.ndarray], np.ndarray]
SITE = int(mujoco.mjtObj.mjOBJ_SITE)


def places(rig: Rig, location: str, position: np.ndarray) -> np.ndarray:
    """A cause's location through a motion, shape (n, k, 3) [m].

    k is 2 for what lies between two points (a spring, or two names joined by "|"), 1 for what sits at one (a body,
    a joint, a channel), and 0 for what has no place of its own.

    Args:
        rig: the structure.
        location: name of a spring, joint, body or channel, or two of them joined by "|"; the ground is nowhere.
        position: of the degrees of freedom from the operating point, (n_dofs, n).
    """
    parts = [points for name in location.split("|") if (points := _points(rig, name)) is not None]
    if not parts:
        return np.zeros((position.shape[1], 0, 3))
    data, found = mujoco.MjData(rig.model), []
    for q in position.T:
        kinematics(rig, q, data)
        found.append(np.concatenate([points(data, q) for points in parts]))
    return np.stack(found)


def arcs(ends: np.ndarray, height: float) -> np.ndarray:
    """Parabolas from the first to the second end, bowed upwards so that they clear what lies between, (n, 17, 3) [m]."""
    s = np.linspace(0.0, 1.0, 17)[:, None]
    straight = ends[:, None, 0] * (1 - s) + ends[:, None, 1] * s
    return np.asarray(straight + 4 * s * (1 - s) * np.array([0.0, 0.0, height]))


def _points(rig: Rig, name: str) -> Points | None:
    """How to find what has that name once the structure has moved: its two ends, or the one point where it sits."""
    if name in [spring.name for spring in rig.springs]:
        return _of_spring(rig, name)
    if name in rig.bodies:
        return _of_body(moving_bodies(rig)[rig.bodies.index(name)])
    for channel in rig.outputs:
        if channel.name == name:
            return _of_sensor(rig, name) or _of_dof(rig, channel.dof)
    for channel in rig.inputs:
        if channel.name == name:
            return _of_dof(rig, channel.dof)
    return _of_dof(rig, name)


def _of_spring(rig: Rig, name: str) -> Points:
    spring, gap = rig.spring(name), spacing(rig)
    foot = anchor(rig, spring, gap)
    return lambda data, q: path(rig.model, data, spring, foot, gap, q)[[0, -1]]


def _of_body(body: int) -> Points:
    return lambda data, q: data.xipos[[body]]


def _of_dof(rig: Rig, name: str) -> Points | None:
    """The body that a joint moves; None where there is no such joint."""
    return _of_body(int(rig.model.jnt_bodyid[rig.dofs.index(name)])) if name in rig.dofs else None


def _of_sensor(rig: Rig, name: str) -> Points | None:
    """The site of a sensor; None for one without."""
    m = rig.model
    sensor = int(np.searchsorted(m.sensor_adr, rig.row_of(name), side="right")) - 1
    if m.sensor_objtype[sensor] != SITE:
        return None
    site = int(m.sensor_objid[sensor])
    return lambda data, q: data.site_xpos[[site]]
