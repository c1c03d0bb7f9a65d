"""A rig as lines and solids: where bodies, springs and forces are at given positions. Knows no viewer."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from lab.rig import Rig, Spring

G = mujoco.mjtGeom
KINDS = {
    G.mjGEOM_SPHERE: "ellipsoid",
    G.mjGEOM_ELLIPSOID: "ellipsoid",
    G.mjGEOM_CAPSULE: "capsule",
    G.mjGEOM_CYLINDER: "cylinder",
    G.mjGEOM_BOX: "box",
    G.mjGEOM_MESH: "mesh",
}
"""Geometry that is drawn; planes and height fields are not."""


@dataclass(frozen=True, eq=False)
class Solid:
    """One piece of geometry in the frame of its body.

    Attributes:
        body: index of the body; 0 is the ground.
        kind: "ellipsoid", "capsule", "cylinder", "box" or "mesh".
        size: MuJoCo's sizes (half lengths, radii), shape (3,) [m].
        position: shape (3,) [m].
        quaternion: x, y, z, w.
        color: red, green, blue, opacity, 0 to 255.
        vertices: of a mesh, shape (n, 3) [m].
        faces: of a mesh, shape (m, 3).
    """

    body: int
    kind: str
    size: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    color: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class Frames:
    """A structure at successive positions.

    Attributes:
        position: of each moving body, shape (n_bodies, n, 3) [m].
        quaternion: likewise, x, y, z, w.
        paths: line of each drawn spring, shape (n, n_points, 3) [m].
        extension: of each drawn spring, shape (n_drawn, n) [m or rad].
        force_origin: of each drawn input, shape (n_forces, n, 3) [m].
        force_direction: likewise, unit vectors.
    """

    position: np.ndarray
    quaternion: np.ndarray
    paths: tuple[np.ndarray, ...]
    extension: np.ndarray
    force_origin: np.ndarray
    force_direction: np.ndarray

    def repeated(self, n_times: int) -> Frames:
        """The same frames over and over."""
        turns = (1, n_times, 1)
        return Frames(
            np.tile(self.position, turns),
            np.tile(self.quaternion, turns),
            tuple(np.tile(path, (n_times, 1, 1)) for path in self.paths),
            np.tile(self.extension, (1, n_times)),
            np.tile(self.force_origin, turns),
            np.tile(self.force_direction, turns),
        )


def moving_bodies(rig: Rig) -> list[int]:
    """Indices of the bodies that can move."""
    return [i for i in range(1, rig.model.nbody) if rig.model.body_weldid[i] != 0]


def driven_inputs(rig: Rig) -> list[int]:
    """Positions of the inputs that push on one named degree of freedom, so that an arrow can show them."""
    return [row for row, channel in enumerate(rig.inputs) if channel.dof in rig.dofs]


def drawn_springs(rig: Rig) -> list[int]:
    """Positions of the springs that have stiffness; mere dampers are not drawn."""
    m = rig.model

    def stiff(spring: Spring) -> bool:
        i = spring.index
        if spring.kind == "joint":
            return bool(m.jnt_stiffness[i] or np.any(m.jnt_stiffnesspoly[i]))
        return bool(m.tendon_stiffness[i] or np.any(m.tendon_stiffnesspoly[i]))

    return [row for row, spring in enumerate(rig.springs) if stiff(spring)]


def solids(rig: Rig) -> list[Solid]:
    """Geometry of all bodies; a moving body without any gets a small ball at its centre of mass."""
    m = rig.model
    found = []
    none = np.zeros((0, 3))
    for i in range(m.ngeom):
        kind = KINDS.get(G(m.geom_type[i]))
        if kind is None or m.geom_rgba[i, 3] == 0:
            continue
        size = m.geom_size[i].copy()
        if m.geom_type[i] == G.mjGEOM_SPHERE:
            size[:] = size[0]
        vertices, faces = _mesh(m, m.geom_dataid[i]) if kind == "mesh" else (none, none)
        color = np.round(255 * m.geom_rgba[i]).astype(np.uint8)
        found.append(
            Solid(
                int(m.geom_bodyid[i]),
                kind,
                size,
                m.geom_pos[i],
                _xyzw(m.geom_quat[i]),
                color,
                vertices,
                faces,
            )
        )
    bare = set(moving_bodies(rig)) - {solid.body for solid in found}
    ball, grey, upright = (
        np.full(3, 0.05 * spacing(rig)),
        np.array([120, 130, 140, 255]),
        np.array([0, 0, 0, 1.0]),
    )
    found += [
        Solid(body, "ellipsoid", ball, m.body_ipos[body], upright, grey, none, none) for body in sorted(bare)
    ]
    return found


def ground_ends(rig: Rig) -> np.ndarray:
    """Where drawn springs meet the ground, shape (n, 3) [m]."""
    m, gap = rig.model, spacing(rig)
    springs = [rig.springs[row] for row in drawn_springs(rig)]
    return np.reshape([_anchor(rig, spring, gap) for spring in springs if _is_grounded(m, spring)], (-1, 3))


def spacing(rig: Rig) -> float:
    """Typical distance between neighbouring bodies [m]: the measure for what has no size of its own."""
    data = _at(rig, np.zeros(rig.model.nv))
    points = data.xipos[1:]
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    nearest = [
        row[row > 1e-9 * rig.model.stat.extent].min()
        for row in gaps
        if np.any(row > 1e-9 * rig.model.stat.extent)
    ]
    return float(np.median(nearest)) if nearest else float(rig.model.stat.extent) / 2


def swing(rig: Rig, position: np.ndarray) -> float:
    """Factor that makes a motion (n_dofs, n) from the operating point plain to see."""
    hinge = rig.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    reach = [
        (0.3 * spacing(rig), np.max(np.abs(position[~hinge]), initial=0.0)),
        (0.4, np.max(np.abs(position[hinge]), initial=0.0)),
    ]
    return float(min((wanted / largest for wanted, largest in reach if largest > 0), default=1.0))


def magnification(rig: Rig, position: np.ndarray) -> float:
    """The largest round factor (1, 2 or 5 times a power of ten) up to `swing`."""
    factor = swing(rig, position)
    power = 10.0 ** np.floor(np.log10(factor))
    return float(f"{power * max(step for step in (1, 2, 5) if step * power <= factor * (1 + 1e-9)):.1g}")


def frames(rig: Rig, position: np.ndarray) -> Frames:
    """Bodies, springs and force arrows at positions (n_dofs, n) from the operating point."""
    n = position.shape[1]
    bodies, springs = moving_bodies(rig), [rig.springs[row] for row in drawn_springs(rig)]
    joints = [rig.dofs.index(rig.inputs[row].dof) for row in driven_inputs(rig)]
    gap = spacing(rig)
    anchors = [_anchor(rig, spring, gap) for spring in springs]
    place = np.empty((len(bodies), n, 3))
    turn = np.empty((len(bodies), n, 4))
    origin, direction = np.empty((2, len(joints), n, 3))
    lines: list[list[np.ndarray]] = [[] for _ in springs]
    data = mujoco.MjData(rig.model)
    for k in range(n):
        _at(rig, position[:, k], data)
        place[:, k] = data.xpos[bodies]
        turn[:, k] = _xyzw(data.xquat[bodies])
        origin[:, k] = data.xipos[rig.model.jnt_bodyid[joints]]
        direction[:, k] = data.xaxis[joints]
        for line, spring, anchor in zip(lines, springs, anchors, strict=True):
            line.append(_path(rig.model, data, spring, anchor, gap, position[:, k]))
    extension = rig.extensions(position)[drawn_springs(rig)]
    return Frames(place, turn, tuple(_even(line) for line in lines), extension, origin, direction)


def _at(rig: Rig, position: np.ndarray, data: mujoco.MjData | None = None) -> mujoco.MjData:
    """Kinematics at a position from the operating point."""
    data = mujoco.MjData(rig.model) if data is None else data
    data.qpos[:] = rig.operating_point + position
    mujoco.mj_kinematics(rig.model, data)
    mujoco.mj_comPos(rig.model, data)
    mujoco.mj_tendon(rig.model, data)
    return data


def _path(
    m: mujoco.MjModel,
    data: mujoco.MjData,
    spring: Spring,
    anchor: np.ndarray,
    gap: float,
    position: np.ndarray,
) -> np.ndarray:
    """Points of a spring's line, shape (n_points, 3); `anchor` is its far end if that is no body."""
    if spring.kind == "joint":
        if m.jnt_type[spring.index] == mujoco.mjtJoint.mjJNT_HINGE:
            return _spiral(
                data.xanchor[spring.index], data.xaxis[spring.index], 0.15 * gap, position[spring.index]
            )
        body = m.jnt_bodyid[spring.index]
        foot = data.xpos[m.body_parentid[body]] + _turn(data, m.body_parentid[body]) @ anchor
        return np.stack([foot, data.xipos[body] + 0.15 * gap * _beside(data.xaxis[spring.index])])
    if _is_spatial(m, spring.index):
        first, count = data.ten_wrapadr[spring.index], data.ten_wrapnum[spring.index]
        points = data.wrap_xpos.reshape(-1, 3)[first : first + count]
        return points[data.wrap_obj.reshape(-1)[first : first + count] != -2].copy()
    ends = data.xipos[list(dict.fromkeys(m.jnt_bodyid[_tendon_joints(m, spring.index)]))]
    return np.stack([anchor, ends[0]]) if len(ends) == 1 else ends.copy()


def _anchor(rig: Rig, spring: Spring, gap: float) -> np.ndarray:
    """Where the far end of a spring is tied, shape (3,) [m], in the frame of the parent body or the ground.

    A fixed tendon on one body says in which direction it pulls, not from where: it is tied to the nearest
    site of the ground on that line, or to a point one spacing away.
    """
    m, data = rig.model, _at(rig, np.zeros(rig.model.nv))
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


def _even(lines: list[np.ndarray]) -> np.ndarray:
    """Lines of one spring with equally many points in every frame: a wrapping tendon has more at times."""
    most = max((len(line) for line in lines), default=0)
    even = [np.concatenate([line, np.repeat(line[-1:], most - len(line), axis=0)]) for line in lines]
    return np.stack(even) if even else np.zeros((0, 0, 3))


def _mesh(m: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray]:
    first, count = m.mesh_vertadr[mesh], m.mesh_vertnum[mesh]
    face, n_faces = m.mesh_faceadr[mesh], m.mesh_facenum[mesh]
    return m.mesh_vert[first : first + count].copy(), m.mesh_face[face : face + n_faces].copy()


def _xyzw(quaternion: np.ndarray) -> np.ndarray:
    """MuJoCo's w, x, y, z as x, y, z, w."""
    return np.roll(quaternion, -1, axis=-1)
