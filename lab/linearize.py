"""Truth of a structure: what MuJoCo's equations come to for small motion about an operating point.

Two independent ways: assembly from the springs, dampers and masses of a model that is linear as written, and central
differences of MuJoCo's forces and accelerations for any other.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import scipy.linalg

from identification.recording import Array
from lab.errors import RigError

DIFFERENCE_STEP = 1e-3
"""Step of the extrapolated central differences, relative to the model's extent: truncation and rounding both near 1e-12."""


def is_smooth(model: mujoco.MjModel) -> bool:
    """Whether no force has a kink: no deadband, dry friction, limit, contact or plastic spring."""
    m = model
    contacts = (
        not m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        and np.any((m.geom_contype != 0) | (m.geom_conaffinity != 0))
        and m.ngeom > 1
    )
    kinked = (
        np.any(m.tendon_lengthspring[:, 0] != m.tendon_lengthspring[:, 1]),
        np.any(m.dof_frictionloss),
        np.any(m.tendon_frictionloss),
        np.any(m.jnt_limited),
        np.any(m.tendon_limited),
        np.any(m.tendon_springyield),
        np.any(m.actuator_ctrllimited),
        np.any(m.actuator_forcelimited),
        contacts,
    )
    return not any(kinked)


def is_linear(model: mujoco.MjModel) -> bool:
    """Whether forces are linear in position, velocity and control at any amplitude."""
    m = model
    fixed_tendons = all(
        m.wrap_type[m.tendon_adr[i] : m.tendon_adr[i] + m.tendon_num[i]].max()
        == int(mujoco.mjtWrap.mjWRAP_JOINT)
        and m.wrap_type[m.tendon_adr[i] : m.tendon_adr[i] + m.tendon_num[i]].min()
        == int(mujoco.mjtWrap.mjWRAP_JOINT)
        for i in range(m.ntendon)
    )
    straight = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_TENDON))
    dynamics = (
        int(mujoco.mjtDyn.mjDYN_NONE),
        int(mujoco.mjtDyn.mjDYN_FILTER),
        int(mujoco.mjtDyn.mjDYN_INTEGRATOR),
    )
    bends = (
        np.any(m.jnt_type != int(mujoco.mjtJoint.mjJNT_SLIDE)),
        not fixed_tendons,
        np.any(m.jnt_stiffnesspoly),
        np.any(m.dof_dampingpoly),
        np.any(m.tendon_stiffnesspoly),
        np.any(m.tendon_dampingpoly),
        np.any(m.actuator_dampingpoly),
        not np.all(np.isin(m.actuator_trntype, straight)),
        np.any(m.actuator_gaintype != int(mujoco.mjtGain.mjGAIN_FIXED)),
        np.any(m.actuator_biastype > int(mujoco.mjtBias.mjBIAS_AFFINE)),
        not np.all(np.isin(m.actuator_dyntype, dynamics)),
        m.opt.density or m.opt.viscosity,
        m.neq,
    )
    return is_smooth(model) and not any(bends)


def equilibrium(model: mujoco.MjModel) -> Array:
    """Joint positions at which the structure stands still at zero control, found by Newton's method from `qpos0`.

    Raises:
        RigError: there is no such position near the reference position.
    """
    m, data = model, mujoco.MjData(model)
    position = m.qpos0.copy()
    force = _static_force(m, data, position)
    scale = _force_scale(m)
    if np.max(np.abs(force)) <= 1e-14 * scale:
        return position
    for _ in range(50):
        K = -_jacobian(lambda q: _static_force(m, data, q), position, DIFFERENCE_STEP * m.stat.extent)
        try:
            step = scipy.linalg.solve(K, force)
        except (scipy.linalg.LinAlgError, scipy.linalg.LinAlgWarning):
            break
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
    if np.max(np.abs(force)) <= 1e-10 * scale:
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

    K = -_jacobian(lambda q: force(q, zero), position, DIFFERENCE_STEP * m.stat.extent)
    C_d = -_jacobian(lambda v: force(position, v), zero, DIFFERENCE_STEP * m.stat.extent)
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

    if exact:
        J = _jacobian(response, center, 1.0, extrapolate=False)
    else:
        J = _jacobian(response, center, DIFFERENCE_STEP * m.stat.extent)
    # Differences of a reading that does not depend on a state leave rounding: it is zero.
    floor = 1e-14 if exact else 1e-11
    J[np.abs(J) < floor * np.max(np.abs(J), axis=1, keepdims=True, initial=1e-300)] = 0.0
    states = 2 * n + m.na
    return J[:states, :states], J[:states, states:], J[states:, :states], J[states:, states:]


def _static_force(model: mujoco.MjModel, data: mujoco.MjData, position: Array) -> Array:
    data.qpos[:], data.qvel[:] = position, 0.0
    mujoco.mj_forward(model, data)
    return np.asarray(data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias + data.qfrc_constraint)


def _force_scale(model: mujoco.MjModel) -> float:
    """A force that counts as large: the weight of everything, or the springs at a thousandth of the extent."""
    stiffest = max(np.max(model.jnt_stiffness, initial=0.0), np.max(model.tendon_stiffness, initial=0.0))
    weight = float(np.sum(model.body_mass) * np.linalg.norm(model.opt.gravity))
    return max(weight, 1e-3 * stiffest * model.stat.extent, 1e-12)


def _jacobian(
    function: Callable[[Array], Array], point: Array, step: float, *, extrapolate: bool = True
) -> Array:
    """Central differences, shape (n_values, n_point); extrapolated over two steps to fourth order."""
    columns = []
    for direction in np.eye(point.size):

        def slope(h: float, direction: Array = direction) -> Array:
            return np.asarray((function(point + h * direction) - function(point - h * direction)) / (2 * h))

        columns.append((4 * slope(step / 2) - slope(step)) / 3 if extrapolate else slope(step))
    return np.stack(columns, axis=1) if columns else np.zeros((0, 0))
