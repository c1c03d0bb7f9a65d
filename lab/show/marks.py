"""Where channels sit on the drawn structure: a point and the direction that each reads or pushes along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from lab.rig import Rig
from lab.show.springs import kinematics

SITE = int(mujoco.mjtObj.mjOBJ_SITE)
JOINT = int(mujoco.mjtObj.mjOBJ_JOINT)


@dataclass(frozen=True, eq=False)
class Mark:
    """A channel on the structure.

    Attributes:
        name: of the channel.
        point: where it sits [m], shape (3,).
        direction: unit vector, shape (3,); zero where it has none.
    """

    name: str
    point: np.ndarray
    direction: np.ndarray


def sensor_marks(rig: Rig, names: Sequence[str]) -> list[Mark]:
    """Marks of output channels, or of all axes of three-axis sensors; channels without a place are left out."""
    m, data = rig.model, kinematics(rig, np.zeros(rig.model.nv))
    found = []
    for channel in rig.outputs:
        if channel.name not in names and channel.name.rpartition(".")[0] not in names:
            continue
        row = rig.row_of(channel.name)
        sensor = int(np.searchsorted(m.sensor_adr, row, side="right")) - 1
        object_, axis = int(m.sensor_objid[sensor]), row - int(m.sensor_adr[sensor])
        if m.sensor_objtype[sensor] == SITE and m.sensor_dim[sensor] == 3:
            site = data.site(object_)
            found.append(Mark(channel.name, site.xpos.copy(), site.xmat.reshape(3, 3)[:, axis].copy()))
        elif m.sensor_objtype[sensor] == JOINT:
            found.append(Mark(channel.name, _center(m, data, object_), data.xaxis[object_].copy()))
        elif channel.dof in rig.dofs:
            joint = rig.dofs.index(channel.dof)
            found.append(Mark(channel.name, _center(m, data, joint), data.xaxis[joint].copy()))
    return found


def actuator_marks(rig: Rig, names: Sequence[str]) -> list[Mark]:
    """Marks of input channels that push on one degree of freedom."""
    m, data = rig.model, kinematics(rig, np.zeros(rig.model.nv))
    found = []
    for channel in rig.inputs:
        if channel.name in names and channel.dof in rig.dofs:
            joint = rig.dofs.index(channel.dof)
            found.append(Mark(channel.name, _center(m, data, joint), data.xaxis[joint].copy()))
    return found


def _center(m: mujoco.MjModel, data: mujoco.MjData, joint: int) -> np.ndarray:
    return np.array(data.xipos[m.jnt_bodyid[joint]])
