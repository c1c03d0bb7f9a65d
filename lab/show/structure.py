"""A rig as solids and lines: where bodies, springs and forces are at given positions. Knows no viewer."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from lab.rig import Rig
from lab.show.springs import anchor, drawn_springs, even, kinematics, path

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


def spacing(rig: Rig) -> float:
    """Typical distance between neighbouring bodies [m]: the measure for what has no size of its own."""
    data = kinematics(rig, np.zeros(rig.model.nv))
    points = data.xipos[1:]
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    nearest = [
        row[row > 1e-9 * rig.model.stat.extent].min()
        for row in gaps
        if np.any(row > 1e-9 * rig.model.stat.extent)
    ]
    return float(np.median(nearest)) if nearest else float(rig.model.stat.extent) / 2


def reach(rig: Rig) -> float:
    """How far anything drawn extends beyond the centres of bodies [m]: the largest solid of a moving body, with some room."""
    m = rig.model
    moving = np.isin(m.geom_bodyid, moving_bodies(rig)) & (m.geom_rgba[:, 3] > 0)
    offset = np.linalg.norm(m.geom_pos, axis=1)
    return max(0.25 * spacing(rig), float(np.max((m.geom_rbound + offset)[moving], initial=0.0)))


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
    feet = [anchor(rig, spring, gap) for spring in springs]
    place = np.empty((len(bodies), n, 3))
    turn = np.empty((len(bodies), n, 4))
    origin, direction = np.empty((2, len(joints), n, 3))
    lines: list[list[np.ndarray]] = [[] for _ in springs]
    data = mujoco.MjData(rig.model)
    for k in range(n):
        kinematics(rig, position[:, k], data)
        place[:, k] = data.xpos[bodies]
        turn[:, k] = _xyzw(data.xquat[bodies])
        origin[:, k] = data.xipos[rig.model.jnt_bodyid[joints]]
        direction[:, k] = data.xaxis[joints]
        for line, spring, foot in zip(lines, springs, feet, strict=True):
            line.append(path(rig.model, data, spring, foot, gap, position[:, k]))
    extension = rig.extensions(position)[drawn_springs(rig)]
    return Frames(place, turn, tuple(even(line) for line in lines), extension, origin, direction)


def _mesh(m: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray]:
    first, count = m.mesh_vertadr[mesh], m.mesh_vertnum[mesh]
    face, n_faces = m.mesh_faceadr[mesh], m.mesh_facenum[mesh]
    return m.mesh_vert[first : first + count].copy(), m.mesh_face[face : face + n_faces].copy()


def _xyzw(quaternion: np.ndarray) -> np.ndarray:
    """MuJoCo's w, x, y, z as x, y, z, w."""
    return np.roll(quaternion, -1, axis=-1)
