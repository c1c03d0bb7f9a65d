"""Where the sensors of a model sit and point to, as nodes, directions and lines between joined bodies."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import mujoco
import numpy as np

from identification.recording import Channel
from lab.files.exporting_points import Points
from lab.files.recording_geometry import Geometry
from lab.ports import name_of
from lab.rig import Rig

S, OBJECT, W = mujoco.mjtSensor, mujoco.mjtObj, mujoco.mjtWrap
LOCAL = (S.mjSENS_ACCELEROMETER, S.mjSENS_VELOCIMETER, S.mjSENS_GYRO)
"""Sensors that measure along the axes of their site; those of frames measure along the axes of the world."""

FRAME = (
    S.mjSENS_FRAMEPOS,
    S.mjSENS_FRAMELINVEL,
    S.mjSENS_FRAMELINACC,
    S.mjSENS_FRAMEANGVEL,
    S.mjSENS_FRAMEANGACC,
)
AT_JOINT = (S.mjSENS_JOINTPOS, S.mjSENS_JOINTVEL)
TURNING = (S.mjSENS_GYRO, S.mjSENS_FRAMEANGVEL, S.mjSENS_FRAMEANGACC)

ALONG = 1 - 1e-9
"""Cosine of the angle below which a sensor counts as along an axis of the world."""


def model_points(rig: Rig, channels: Sequence[Channel]) -> Points:
    """Points of the channels that are sensors of the rig, at rest.

    Sensors at one place of one body share a node. A sensor along no axis of the world has no point: universal
    files would need a coordinate system of its own.
    """
    m = rig.model
    data = mujoco.MjData(m)
    data.qpos[:] = rig.operating_point
    mujoco.mj_kinematics(m, data)
    mujoco.mj_comPos(m, data)
    nodes: dict[tuple[int, tuple[float, ...]], int] = {}
    places: dict[str, tuple[int, int]] = {}
    oblique = []
    wanted = {channel.name for channel in channels}
    for i in range(m.nsensor):
        base, width = name_of(m, "sensor", i), int(m.sensor_dim[i])
        names = [f"{base}.{axis}" for axis in "xyz"] if width == 3 else [base]
        placed = _placed(m, data, i)
        if placed is None or not wanted & set(names):
            continue
        body, position, axes, turning = placed
        node = nodes.setdefault((body, tuple(np.round(position, 9))), len(nodes) + 1)
        for name, axis in zip(names, axes, strict=True):
            k = int(np.argmax(np.abs(axis)))
            if abs(axis[k]) < ALONG:
                oblique.append(name)
            elif name in wanted:
                places[name] = (node, int(np.sign(axis[k])) * (k + 1 + 3 * turning))
    notes = (f"along no axis of the world: {', '.join(oblique)}",) if wanted & set(oblique) else ()
    if not nodes:
        return Points(places, None, notes)
    where = np.array([position for _, position in nodes])
    return Points(places, Geometry(tuple(nodes.values()), where, _lines(m, nodes)), notes)


def _placed(
    m: mujoco.MjModel, data: mujoco.MjData, sensor: int
) -> tuple[int, np.ndarray, np.ndarray, bool] | None:
    """Body, position, axes (one or three rows) of a sensor of motion, and whether it turns."""
    kind, target = S(m.sensor_type[sensor]), int(m.sensor_objid[sensor])
    if kind in AT_JOINT:
        turning = m.jnt_type[target] == mujoco.mjtJoint.mjJNT_HINGE
        body = int(m.jnt_bodyid[target])
        # A slide has no place of its own: its body moves as one.
        position = data.xanchor[target] if turning else data.xipos[body]
        return body, position, data.xaxis[target][None], bool(turning)
    if kind not in (*LOCAL, *FRAME) or m.sensor_refid[sensor] >= 0:
        return None
    what = OBJECT(m.sensor_objtype[sensor])
    if what == OBJECT.mjOBJ_SITE:
        body, position, frame = int(m.site_bodyid[target]), data.site_xpos[target], data.site_xmat[target]
    elif what == OBJECT.mjOBJ_BODY:
        body, position, frame = target, data.xipos[target], data.ximat[target]
    elif what == OBJECT.mjOBJ_XBODY:
        body, position, frame = target, data.xpos[target], data.xmat[target]
    else:
        return None
    axes = frame.reshape(3, 3).T if kind in LOCAL else np.eye(3)
    return body, position, axes, kind in TURNING


def _lines(m: mujoco.MjModel, nodes: dict[tuple[int, tuple[float, ...]], int]) -> tuple[tuple[int, int], ...]:
    """Pairs of nodes on bodies that a tendon or the tree joins, or that are one body."""
    bodies: dict[int, list[int]] = {}
    for (body, _), node in nodes.items():
        bodies.setdefault(body, []).append(node)
    joined = {(int(m.body_parentid[body]), body) for body in bodies}
    for tendon in range(m.ntendon):
        first = int(m.tendon_adr[tendon])
        wraps = range(first, first + int(m.tendon_num[tendon]))
        ends = sorted({each for w in wraps if (each := _wrapped(m, w)) is not None})
        joined |= set(combinations(ends, 2)) if len(ends) == 2 else set()
    pairs = {
        (min(a, b), max(a, b))
        for i, j in joined
        for a in bodies.get(i, [])[:1]
        for b in bodies.get(j, [])[:1]
    }
    pairs |= {(group[0], other) for group in bodies.values() for other in group[1:]}
    return tuple(sorted((a, b) for a, b in pairs if a != b))


def _wrapped(m: mujoco.MjModel, wrap: int) -> int | None:
    kind, target = W(m.wrap_type[wrap]), int(m.wrap_objid[wrap])
    if kind == W.mjWRAP_JOINT:
        return int(m.jnt_bodyid[target])
    return int(m.site_bodyid[target]) if kind == W.mjWRAP_SITE else None
