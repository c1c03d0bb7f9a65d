"""Force laws that MJCF has no words for, written as user actuators on a spring.

Plain MuJoCo loads a model that has them and leaves their force at zero; under `acting` they act, inside every stage of the
integrator.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

from lab.mjcf import free_name, number
from lab.ports import is_law
from lab.rig import Rig, Spring

HYSTERESIS, DRIFT = "hysteresis", "drift"
USER_BIAS = int(mujoco.mjtBias.mjBIAS_USER)


def with_hysteresis(rig: Rig, spring: Spring, stiffness: float, yield_displacement: float) -> Rig:
    """The rig with a Bouc-Wen force at a spring."""
    element = ET.Element("general", name=f"{HYSTERESIS}@{spring.name}")
    element.set(spring.kind, spring.name)
    element.set("dyntype", "user")
    element.set("actdim", "1")
    element.set("dynprm", f"{number(stiffness)} {number(yield_displacement)}")
    element.set("gainprm", "-1")
    return _with_actuator(rig, element)


def with_drift(rig: Rig, spring: Spring, change: float) -> Rig:
    """The rig with a stiffness at a spring that grows from nothing to `change` [N/m] over each record."""
    element = ET.Element("general", name=f"{DRIFT}@{spring.name}")
    element.set(spring.kind, spring.name)
    element.set("gainprm", "0")
    element.set("biastype", "user")
    element.set("biasprm", f"{number(change)} {number(spring.reference)} 0")
    return _with_actuator(rig, element)


def set_duration(model: mujoco.MjModel, duration: float) -> None:
    """Tells the drifting springs of a model how long the record is [s]."""
    model.actuator_biasprm[model.actuator_biastype == USER_BIAS, 2] = duration


@contextmanager
def acting(model: mujoco.MjModel) -> Iterator[None]:
    """Lets the force laws of a model act, if it has any."""
    if not np.any(is_law(model)):
        yield
        return
    before = mujoco.get_mjcb_act_dyn(), mujoco.get_mjcb_act_bias()
    mujoco.set_mjcb_act_dyn(_bouc_wen)
    mujoco.set_mjcb_act_bias(_drifting)
    try:
        yield
    finally:
        mujoco.set_mjcb_act_dyn(before[0])
        mujoco.set_mjcb_act_bias(before[1])


def _bouc_wen(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    stiffness, yield_displacement = model.actuator_dynprm[actuator, :2]
    v, z = data.actuator_velocity[actuator], data.act[model.actuator_actadr[actuator]]
    return float(stiffness * v - (abs(v) * z + v * abs(z)) / (2 * yield_displacement))


def _drifting(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> float:
    change, reference, duration = model.actuator_biasprm[actuator, :3]
    if not duration:
        return 0.0
    return float(-change * data.time / duration * (data.actuator_length[actuator] - reference))


def _with_actuator(rig: Rig, element: ET.Element) -> Rig:
    def edit(root: ET.Element) -> None:
        found = root.findall("actuator")
        element.set("name", free_name(root, element.get("name", "")))
        (found[-1] if found else ET.SubElement(root, "actuator")).append(element)

    return rig.edited(edit)
