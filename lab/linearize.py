"""Truth of a structure: what MuJoCo's equations come to for small motion about an operating point.

Two independent ways: assembly from the springs, dampers and masses of a model that is linear as written, and central
differences of MuJoCo's forces and accelerations for any other. Models come without kinks here, see `lab.tangent`.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from identification.recording import Array
from lab.errors import RigError

DIFFERENCE_STEP = 1e-3
"""Step of the extrapolated central differences, of the model's extent or in radians: truncation and rounding near 1e-12."""


def equilibrium(model: mujoco.MjModel) -> Array:
    """Joint positions at which the structure stands still at zero control, found by Newton's method from `qpos0`.

    Dry friction, which could hold it anywhere near, is left out.

    Raises:
        RigError: there is no such position near the reference position.
    """
    m = copy.copy(model)
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
    data = mujoco.MjData(m)
    position = m.qpos0.copy()
    force = _static_force(m, data, position)
    scale = _force_scale(m)
    if np.max(np.abs(force)) <= 1e-14 * scale:
        return position
    for _ in range(50):
        K = -differences(lambda q: _static_force(m, data, q), position, motion_steps(m))
        # A structure that can float in some direction stays where it is in that direction.
        step = np.linalg.lstsq(K, force, rcond=1e-10)[0]
        for halvings in range(30):
            trial = position + step * 0.5**halvings
            trial_force = _static_force(m, data, trial)
            if np.linalg.norm(trial_force) < np.linalg.norm(force):
                break
        else:
            break
        position, force = trial, trial_force
        if np.max(np.abs(force)) <= 1e-13 * scale:
            return position
    if np.max(np.abs(force)) <= 1e-8 * scale:
        return position
    raise RigError(
        f"the model finds no position of rest near its reference position (a force of {np.max(np.abs(force)):.3g} remains); "
        "switch gravity off, or give every joint that a load pulls on a spring"
    )


def matrices(model: mujoco.MjModel, position: Array, *, analytic: bool) -> tuple[Array, Array, Array]:
    """M, C_d and K of small motion, each (n_dofs, n_dofs).

    Args:
        model: compiled model.
        position: operating point, shape (n_dofs,).
        analytic: assemble from springs and dampers (exact for a linear model); otherwise difference the forces.

    Raises:
        RigError: the model has equality constraints.
    """
    if model.neq:
        raise RigError(
            f"the model has {model.neq} equality constraints, which M, C and K cannot hold; write them as stiff springs"
        )
    data = mujoco.MjData(model)
    data.qpos[:] = position
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    C_d, K = _assembled(model, data) if analytic else _differenced(model, data, position)
    return M, C_d, K


def _assembled(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array]:
    m = model
    K, C_d = np.zeros((m.nv, m.nv)), np.diag(m.dof_damping).astype(float)
    K[m.jnt_dofadr, m.jnt_dofadr] += m.jnt_stiffness
    if m.ntendon:
        J = np.zeros((m.ntendon, m.nv))
        mujoco.mju_sparse2dense(J, data.ten_J, m.ten_J_rownnz, m.ten_J_rowadr, m.ten_J_colind)
        K += J.T @ (m.tendon_stiffness[:, None] * J)
        C_d += J.T @ (m.tendon_damping[:, None] * J)
    if m.nu:
        G = np.zeros((m.nu, m.nv))
        mujoco.mju_sparse2dense(
            G, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
        affine = m.actuator_biastype == int(mujoco.mjtBias.mjBIAS_AFFINE)
        K -= G.T @ ((affine * m.actuator_biasprm[:, 1])[:, None] * G)
        C_d += G.T @ ((m.actuator_damping - affine * m.actuator_biasprm[:, 2])[:, None] * G)
    return C_d, K


def _differenced(model: mujoco.MjModel, data: mujoco.MjData, position: Array) -> tuple[Array, Array]:
    m, zero = model, np.zeros(model.nv)

    def force(q: Array, v: Array) -> Array:
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(m, data)
        return np.asarray(data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias)

    K = -differences(lambda q: force(q, zero), position, motion_steps(m))
    C_d = -differences(lambda v: force(position, v), zero, motion_steps(m))
    return C_d, K


def state_space(model: mujoco.MjModel, position: Array, *, exact: bool) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D of the continuous state (q - q0, q̇, activation), with all of `sensordata` as outputs.

    Args:
        model: compiled model.
        position: operating point q0, shape (n_dofs,).
        exact: the model is linear, so that a difference over any step is exact to rounding.

    Returns:
        B and D have one column per control, then one per force on a degree of freedom.
    """
    m, data, n = model, mujoco.MjData(model), model.nv
    center = np.concatenate([position, np.zeros(n + m.na + m.nu + n)])
    ends = np.cumsum([n, n, m.na, m.nu])

    def response(point: Array) -> Array:
        data.qpos[:], data.qvel[:], data.act[:], data.ctrl[:], data.qfrc_applied[:] = np.split(point, ends)
        mujoco.mj_forward(m, data)
        return np.concatenate([data.qvel, data.qacc, data.act_dot, data.sensordata])

    # The response is linear in controls and forces in any case: a large force drowns rounding.
    force = np.full(m.na + m.nu + n, max(1.0, _force_scale(m)))
    steps = np.ones(center.size) if exact else np.concatenate([motion_steps(m), motion_steps(m), force])
    J = differences(response, center, steps, extrapolate=not exact)
    states = 2 * n + m.na
    rows = [*range(states), *(states + m.sensor_adr)]
    _drop_rounding(J, rows, ends, 1e-14 if exact else 1e-11, np.abs(response(center)) / np.min(steps))
    return J[:states, :states], J[:states, states:], J[states:, :states], J[states:, states:]


def _drop_rounding(J: Array, rows: Sequence[int], columns: Array, floor: float, offset: Array) -> None:
    """Sets to zero what differences leave of a reading that does not depend on a kind of variable.

    Args:
        J: shape (n_readings, n_variables).
        rows: first row of each state or sensor; the axes of a sensor share a scale.
        columns: last column but one of each kind of variable, since kinds differ in unit.
        floor: relative to the largest entry of a block.
        offset: constant part of each reading over the step, whose rounding is in the difference.
    """
    for sensor, constant in zip(np.split(J, rows[1:]), np.split(offset, rows[1:]), strict=True):
        for block in np.split(sensor, columns, axis=1):
            if block.size:
                noise = max(floor * np.max(np.abs(block)), 1e-15 * np.max(constant))
                block[np.abs(block) < noise] = 0.0


def motion_steps(model: mujoco.MjModel) -> Array:
    """Steps for differences in the position or velocity of every joint, shape (n_dofs,) [m or rad, and per s]."""
    hinge = model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)
    return DIFFERENCE_STEP * np.where(hinge, 1.0, model.stat.extent)


def _static_force(model: mujoco.MjModel, data: mujoco.MjData, position: Array) -> Array:
    data.qpos[:], data.qvel[:] = position, 0.0
    mujoco.mj_forward(model, data)
    return np.asarray(data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias + data.qfrc_constraint)


def _force_scale(model: mujoco.MjModel) -> float:
    """A force that counts as large: the weight of everything, or the springs at a thousandth of the extent."""
    stiffest = max(np.max(model.jnt_stiffness, initial=0.0), np.max(model.tendon_stiffness, initial=0.0))
    weight = float(np.sum(model.body_mass) * np.linalg.norm(model.opt.gravity))
    return max(weight, 1e-3 * stiffest * model.stat.extent, 1e-12)


def differences(
    function: Callable[[Array], Array], point: Array, steps: Array, *, extrapolate: bool = True
) -> Array:
    """Central differences, shape (n_values, n_point); extrapolated over two steps to fourth order."""
    columns = []
    for direction, h in zip(np.eye(point.size), steps, strict=True):

        def slope(h: float, direction: Array = direction) -> Array:
            return np.asarray((function(point + h * direction) - function(point - h * direction)) / (2 * h))

        columns.append((4 * slope(h / 2) - slope(h)) / 3 if extrapolate else slope(h))
    return np.stack(columns, axis=1)
