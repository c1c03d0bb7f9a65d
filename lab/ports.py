"""Ports: the channels that a compiled model offers, with their units and the degree of freedom each one belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from identification.recording import Array, Channel
from lab.errors import RigError, UnknownNameError
from lab.linearize import differences, motion_steps

S = mujoco.mjtSensor
UNITS = {
    S.mjSENS_ACCELEROMETER: "m/s^2",
    S.mjSENS_VELOCIMETER: "m/s",
    S.mjSENS_GYRO: "rad/s",
    S.mjSENS_FORCE: "N",
    S.mjSENS_TORQUE: "N m",
    S.mjSENS_TENDONPOS: "m",
    S.mjSENS_TENDONVEL: "m/s",
    S.mjSENS_TENDONACTFRC: "N",
    S.mjSENS_FRAMEPOS: "m",
    S.mjSENS_FRAMELINVEL: "m/s",
    S.mjSENS_FRAMEANGVEL: "rad/s",
    S.mjSENS_FRAMELINACC: "m/s^2",
    S.mjSENS_FRAMEANGACC: "rad/s^2",
    S.mjSENS_SUBTREECOM: "m",
    S.mjSENS_SUBTREELINVEL: "m/s",
}
"""Sensors that are output channels; sensors of joints and actuators follow the kind of their joint."""
JOINT_UNITS = {
    S.mjSENS_JOINTPOS: ("m", "rad"),
    S.mjSENS_JOINTVEL: ("m/s", "rad/s"),
    S.mjSENS_JOINTACTFRC: ("N", "N m"),
}
ACTUATOR_UNITS = {
    S.mjSENS_ACTUATORPOS: ("m", "rad"),
    S.mjSENS_ACTUATORVEL: ("m/s", "rad/s"),
    S.mjSENS_ACTUATORFRC: ("N", "N m"),
}
HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
AT_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
DERIVATIVE = {"m": 0, "rad": 0, "m/s": 1, "rad/s": 1, "m/s^2": 2, "rad/s^2": 2}


@dataclass(frozen=True, eq=False)
class Ports:
    """Every channel of a model.

    Attributes:
        inputs: one channel per actuator.
        outputs: one channel per scalar reading.
        rows: position of each output in `sensordata`.
    """

    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    rows: list[int]

    def pick_inputs(self, names: Sequence[str] | None) -> tuple[list[int], tuple[Channel, ...]]:
        """Positions and channels of the named inputs (all when None)."""
        return _pick(self.inputs, names, "input")

    def pick_outputs(self, names: Sequence[str] | None) -> tuple[list[int], tuple[Channel, ...]]:
        """Positions and channels of the named outputs (all when None)."""
        return _pick(self.outputs, names, "output")


def find(model: mujoco.MjModel, position: Array) -> Ports:
    """The channels of a model about the joint positions given.

    Raises:
        RigError: two channels share a name.
    """
    names = [name_of(model, "joint", i) for i in range(model.njnt)]
    columns = _force_columns(model, position).T
    inputs = [_input(model, i, columns[i], names) for i in range(model.nu) if not is_law(model)[i]]
    jacobians = _sensor_jacobians(model, position)
    outputs, rows = [], []
    for i in range(model.nsensor):
        unit = _unit(model, i)
        if unit is None:
            continue
        base, width, address = name_of(model, "sensor", i), model.sensor_dim[i], model.sensor_adr[i]
        for axis in range(width):
            name = f"{base}.{'xyz'[axis]}" if width == 3 else base
            row = address + axis
            dof, factor = (
                _single(jacobians[DERIVATIVE[unit]][row], names) if unit in DERIVATIVE else ("", 1.0)
            )
            outputs.append(Channel(name, unit, dof, factor))
            rows.append(int(row))
    for side, channels in (("actuators", inputs), ("sensors", outputs)):
        listed = [c.name for c in channels]
        if len(set(listed)) < len(listed):
            double = next(n for n in listed if listed.count(n) > 1)
            raise RigError(f"two {side} are called {double!r}; expected unique names")
    return Ports(tuple(inputs), tuple(outputs), rows)


def is_law(model: mujoco.MjModel) -> np.ndarray:
    """Which actuators are force laws of the lab (`lab.laws`) rather than inputs, shape (n_actuators,)."""
    dynamics, bias = int(mujoco.mjtDyn.mjDYN_USER), int(mujoco.mjtBias.mjBIAS_USER)
    return np.asarray((model.actuator_dyntype == dynamics) | (model.actuator_biastype == bias))


def name_of(model: mujoco.MjModel, kind: str, index: int) -> str:
    """Name of a model element, or its kind and number when it has none."""
    return getattr(model, kind)(index).name or f"{kind}{index}"


def _pick(
    channels: tuple[Channel, ...], names: Sequence[str] | None, side: str
) -> tuple[list[int], tuple[Channel, ...]]:
    if names is None:
        return list(range(len(channels))), channels
    position = {c.name: i for i, c in enumerate(channels)}
    for name in names:
        if name not in position:
            raise UnknownNameError(
                f"{side} channel {name!r} does not exist in the model; there are {', '.join(position) or 'none'}"
            )
    chosen = [position[name] for name in names]
    return chosen, tuple(channels[i] for i in chosen)


def _unit(model: mujoco.MjModel, sensor: int) -> str | None:
    kind, target = S(model.sensor_type[sensor]), model.sensor_objid[sensor]
    if kind in JOINT_UNITS:
        return JOINT_UNITS[kind][int(model.jnt_type[target] == HINGE)]
    if kind in ACTUATOR_UNITS:
        return ACTUATOR_UNITS[kind][int(_turns(model, target))]
    return UNITS.get(kind)


def _turns(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator acts on a hinge."""
    at_joint = model.actuator_trntype[actuator] in AT_JOINT
    return bool(at_joint and model.jnt_type[model.actuator_trnid[actuator, 0]] == HINGE)


def _input(model: mujoco.MjModel, actuator: int, column: Array, names: list[str]) -> Channel:
    dof, factor = _single(column, names)
    # A servo turns its control into a force proportional to position or velocity: the control has that unit.
    affine = model.actuator_biastype[actuator] == int(mujoco.mjtBias.mjBIAS_AFFINE)
    bias = affine * model.actuator_biasprm[actuator]
    integrates = model.actuator_dyntype[actuator] == int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
    if bias[1] and not integrates:
        unit = ("m", "rad")
    elif bias[1] or bias[2]:
        unit = ("m/s", "rad/s")
    else:
        unit = ("N", "N m")
    return Channel(name_of(model, "actuator", actuator), unit[int(_turns(model, actuator))], dof, factor)


def _single(row: Array, names: list[str]) -> tuple[str, float]:
    """The one degree of freedom that a row of coefficients touches, and its coefficient."""
    largest = np.max(np.abs(row), initial=0.0)
    touched = np.flatnonzero(np.abs(row) > 1e-9 * largest)
    if largest < 1e-12 or touched.size != 1:
        return "", 1.0
    value = float(row[touched[0]])
    # Direction cosines come out of rotations: -1 and 1 are meant where they are met to rounding.
    return names[touched[0]], float(np.round(value)) if abs(abs(value) - 1) < 1e-9 else value


def _force_columns(model: mujoco.MjModel, position: Array) -> Array:
    """Generalized force per unit of control (of activation, for a filtered actuator), shape (n_dofs, n_controls)."""
    data = mujoco.MjData(model)
    data.qpos[:] = position
    mujoco.mj_fwdPosition(model, data)
    moment = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    laws = is_law(model)
    gains = np.array([0.0 if laws[i] else _gain(model, i, data) for i in range(model.nu)])
    return (moment * gains[:, None]).T if model.nu else np.zeros((model.nv, 0))


def _gain(model: mujoco.MjModel, actuator: int, data: mujoco.MjData) -> float:
    gain = model.actuator_gainprm[actuator]
    if model.actuator_gaintype[actuator] == int(mujoco.mjtGain.mjGAIN_FIXED):
        return float(gain[0])
    if model.actuator_gaintype[actuator] == int(mujoco.mjtGain.mjGAIN_AFFINE):
        return float(gain[0] + gain[1] * data.actuator_length[actuator])
    raise RigError(
        f"actuator {name_of(model, 'actuator', actuator)!r} is a muscle or has its own gain law; expected a motor, "
        "position, velocity or general actuator with fixed or affine gain"
    )


def _sensor_jacobians(model: mujoco.MjModel, position: Array) -> tuple[Array, Array, Array]:
    """Readings per unit of position, velocity and acceleration of each joint, each (n_sensordata, n_dofs)."""
    data, still = mujoco.MjData(model), np.zeros(model.nv)

    def readings(q: Array, v: Array, a: Array) -> Array:
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_sensorPos(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_sensorVel(model, data)
        data.qacc[:] = a
        mujoco.mj_rnePostConstraint(model, data)
        mujoco.mj_sensorAcc(model, data)
        return data.sensordata.copy()

    # Readings of velocity and acceleration are linear in them, so that any step is exact.
    ones = np.ones(model.nv)
    return (
        differences(lambda q: readings(q, still, still), position, motion_steps(model)),
        differences(lambda v: readings(position, v, still), still, ones, extrapolate=False),
        differences(lambda a: readings(position, still, a), still, ones, extrapolate=False),
    )
