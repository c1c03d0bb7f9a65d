"""Springs as lines: from where to where each one runs at a given position."""

from __future__ import annotations

import mujoco
import numpy as np

from lab.rig import Rig, Spring


def drawn_springs(rig: Rig) -> list[int]:
    """Positions of the springs that have stiffness; mere dampers are not drawn."""
    m = rig.model

    def stiff(spring: Spring) -> bool:
        i = spring.index
        if spring.kind == "joint":
            return bool(m.jnt_stiffness[i] or np.any(m.jnt_stiffnesspoly[i]))
        return bool(m.tendon_stiffness[i] or np.any(m.tendon_stiffnesspoly[i]))

    return [row for row, spring in enumerate(rig.springs) if stiff(spring)]


def ground_ends(rig: Rig, gap: float) -> np.ndarray:
    """Where drawn springs meet the ground, shape (n, 3) [m]; `gap` measures what has no size of its own."""
    springs = [rig.springs[row] for row in drawn_springs(rig)]
    feet = [anchor(rig, spring, gap) for spring in springs if _is_grounded(rig.model, spring)]
    return np.reshape(feet, (-1, 3))


def kinematics(rig: Rig, position: np.ndarray, data: mujoco.MjData | None = None) -> mujoco.MjData:
    """Where everything is at a position (n_dofs,) from the operating point; into `data` where given."""
    data = mujoco.MjData(rig.model) if data is None else data
    data.qpos[:] = rig.operating_point + position
    mujoco.mj_kinematics(rig.model, data)
    mujoco.mj_comPos(rig.model, data)
    mujoco.mj_tendon(rig.model, data)
    return data


def path(
    m: mujoco.MjModel,
    data: mujoco.MjData,
    spring: Spring,
    foot: np.ndarray,
    gap: float,
    position: np.ndarray,
) -> np.ndarray:
    """Points of a spring's line, shape (n_points, 3); `foot` is its far end if that is no body."""
    if spring.kind == "joint":
        if m.jnt_type[spring.index] == mujoco.mjtJoint.mjJNT_HINGE:
            return _spiral(
                data.xanchor[spring.index], data.xaxis[spring.index], 0.15 * gap, position[spring.index]
            )
        body = m.jnt_bodyid[spring.index]
        tied = data.xpos[m.body_parentid[body]] + _turn(data, m.body_parentid[body]) @ foot
        return np.stack([tied, data.xipos[body] + 0.15 * gap * _beside(data.xaxis[spring.index])])
    if _is_spatial(m, spring.index):
        first, count = data.ten_wrapadr[spring.index], data.ten_wrapnum[spring.index]
        points = data.wrap_xpos.reshape(-1, 3)[first : first + count]
        return points[data.wrap_obj.reshape(-1)[first : first + count] != -2].copy()
    ends = data.xipos[list(dict.fromkeys(m.jnt_bodyid[_tendon_joints(m, spring.index)]))]
    return np.stack([foot, ends[0]]) if len(ends) == 1 else ends.copy()


def anchor(rig: Rig, spring: Spring, gap: float) -> np.ndarray:
    """Where the far end of a spring is tied, shape (3,) [m], in the frame of the parent body or the ground.

    A fixed tendon on one body says in which direction it pulls, not from where: it is tied to the nearest
    site of the ground on that line, or to a point one spacing away.
    """
    m, data = rig.model, kinematics(rig, np.zeros(rig.model.nv))
    if spring.kind == "joint":
        axis, body = data.xaxis[spring.index], m.jnt_bodyid[spring.index]
        foot = data.xipos[body] - 0.6 * gap * axis + 0.15 * gap * _beside(axis)
        return _turn(data, m.body_parentid[body]).T @ (foot - data.xpos[m.body_parentid[body]])
    joints = _tendon_joints(m, spring.index)
    pull = (
        np.sum([m.wrap_prm[w] * data.xaxis[j] for w, j in _tendon_terms(m, spring.index)], axis=0)
        if joints
        else np.zeros(3)
    )
    length = np.linalg.norm(pull)
    if not joints or length == 0:
        return np.zeros(3)
    start, pull = data.xipos[m.jnt_bodyid[joints[0]]], pull / length
    sites = data.site_xpos[m.body_weldid[m.site_bodyid] == 0] - start
    along = -sites @ pull
    aside = np.linalg.norm(sites + along[:, None] * pull, axis=1)
    near = (along > 0.05 * gap) & (aside < 0.02 * gap)
    return start - pull * (along[near].min() if near.any() else gap)


def _is_grounded(m: mujoco.MjModel, spring: Spring) -> bool:
    """Whether one end is drawn on the ground: of a slide's own spring there, or of a tendon on one body."""
    if spring.kind == "joint":
        body = m.jnt_bodyid[spring.index]
        slide = m.jnt_type[spring.index] == mujoco.mjtJoint.mjJNT_SLIDE
        return bool(slide and m.body_weldid[m.body_parentid[body]] == 0)
    return len({int(m.jnt_bodyid[joint]) for joint in _tendon_joints(m, spring.index)}) == 1


def _is_spatial(m: mujoco.MjModel, tendon: int) -> bool:
    return m.wrap_type[m.tendon_adr[tendon]] != mujoco.mjtWrap.mjWRAP_JOINT


def _turn(data: mujoco.MjData, body: int) -> np.ndarray:
    """Rotation of a body, shape (3, 3)."""
    return data.xmat[body].reshape(3, 3)


def _tendon_terms(m: mujoco.MjModel, tendon: int) -> list[tuple[int, int]]:
    """Position of each coefficient of a fixed tendon, and its joint; none for a spatial one."""
    if _is_spatial(m, tendon):
        return []
    first = m.tendon_adr[tendon]
    return [(w, int(m.wrap_objid[w])) for w in range(first, first + m.tendon_num[tendon])]


def _tendon_joints(m: mujoco.MjModel, tendon: int) -> list[int]:
    return [joint for _, joint in _tendon_terms(m, tendon)]


def _beside(axis: np.ndarray) -> np.ndarray:
    """A unit vector across `axis`, downwards where that is possible."""
    down = np.array([0.0, 0.0, -1.0]) if abs(axis[2]) < 0.9 else np.array([0.0, -1.0, 0.0])
    across = down - axis * (down @ axis)
    return across / np.linalg.norm(across)


def _spiral(center: np.ndarray, axis: np.ndarray, radius: float, angle: float) -> np.ndarray:
    """A torsion spring: its inner end stands, its outer end turns with the joint."""
    s = np.linspace(0.1, 1.0, 41)[:, None]
    e1 = _beside(axis)
    e2 = np.cross(axis, e1)
    theta = s * (3.5 * np.pi + angle)
    return center + radius * s * (np.cos(theta) * e1 + np.sin(theta) * e2)


def even(lines: list[np.ndarray]) -> np.ndarray:
    """Lines of one spring with equally many points in every frame: a wrapping tendon has more at times."""
    most = max((len(line) for line in lines), default=0)
    even = [np.concatenate([line, np.repeat(line[-1:], most - len(line), axis=0)]) for line in lines]
    return np.stack(even) if even else np.zeros((0, 0, 3))
