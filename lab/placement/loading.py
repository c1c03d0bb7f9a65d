"""Loading: what the mass of the sensors themselves does to the natural frequencies."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import scipy.linalg

from identification.recording import Array
from lab.errors import RigError
from lab.rig import Rig

JOINT_SENSORS = (int(mujoco.mjtObj.mjOBJ_JOINT),)
SITE_SENSORS = (int(mujoco.mjtObj.mjOBJ_SITE),)
BODY_SENSORS = (int(mujoco.mjtObj.mjOBJ_BODY), int(mujoco.mjtObj.mjOBJ_XBODY))


def added_mass(rig: Rig, channels: Sequence[str], mass: float) -> Array:
    """What sensors add to the mass matrix, shape (n_dofs, n_dofs) [kg].

    Args:
        rig: structure.
        channels: output channels; the axes of one sensor count once.
        mass: of each sensor [kg], which follows its site, or the body of its joint, in all directions.

    Raises:
        RigError: a sensor sits on no site, joint or body.
    """
    m, data = rig.model, mujoco.MjData(rig.model)
    data.qpos[:] = rig.operating_point
    mujoco.mj_forward(m, data)
    addresses = [rig.row_of(name) for name in channels]
    sensors = sorted({int(np.searchsorted(m.sensor_adr, row, side="right")) - 1 for row in addresses})
    total = np.zeros((m.nv, m.nv))
    for sensor in sensors:
        J, object_ = np.zeros((3, m.nv)), int(m.sensor_objid[sensor])
        kind = int(m.sensor_objtype[sensor])
        if kind in SITE_SENSORS:
            mujoco.mj_jacSite(m, data, J, None, object_)
        elif kind in JOINT_SENSORS:
            mujoco.mj_jacBodyCom(m, data, J, None, int(m.jnt_bodyid[object_]))
        elif kind in BODY_SENSORS:
            mujoco.mj_jacBodyCom(m, data, J, None, object_)
        else:
            raise RigError(
                f"sensor {m.sensor(sensor).name!r} sits on no site, joint or body, so nothing says where its mass is; "
                "leave the sensor mass out"
            )
        total += mass * J.T @ J
    return total


def frequency_shifts(mass: Array, stiffness: Array, shapes: Array, added: Array) -> Array:
    """Relative change of each natural frequency when mass is added, shape (n_modes,).

    Args:
        mass, stiffness: M and K, shape (n_dofs, n_dofs).
        shapes: modes of the bare structure, normalised to unit modal mass, shape (n_dofs, n_modes).
        added: mass added, shape (n_dofs, n_dofs).
    """
    values, loaded = scipy.linalg.eigh(stiffness, mass + added)
    before = np.einsum("im,ij,jm->m", shapes, stiffness, shapes)
    # A mode keeps its name though the order may change: it goes with the loaded mode that moves most alike.
    partner = np.argmax(np.abs(shapes.T @ mass @ loaded), axis=1)
    return np.asarray(np.sqrt(np.maximum(values[partner], 0.0) / before) - 1)
