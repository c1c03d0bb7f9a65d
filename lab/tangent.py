"""What bends and what kinks in a structure, and the structure as it is for small motion where kinks are left alone."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from identification.recording import Array

JOINT, TENDON = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_TENDON)
LINEAR_DYNAMICS = [
    int(kind)
    for kind in (
        mujoco.mjtDyn.mjDYN_NONE,
        mujoco.mjtDyn.mjDYN_FILTER,
        mujoco.mjtDyn.mjDYN_FILTEREXACT,
        mujoco.mjtDyn.mjDYN_INTEGRATOR,
    )
]
SWITCHES = int(
    mujoco.mjtDisableBit.mjDSBL_SPRING
    | mujoco.mjtDisableBit.mjDSBL_DAMPER
    | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    | mujoco.mjtDisableBit.mjDSBL_SENSOR
)
"""Flags that take forces or readings out of a model as written."""


def is_smooth(model: mujoco.MjModel) -> bool:
    """Whether nothing has a kink: no deadband, dry friction, limit, contact, plastic spring or clipped signal."""
    m = model
    contacts = not m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT) and (
        m.npair or (m.ngeom > 1 and np.any((m.geom_contype != 0) | (m.geom_conaffinity != 0)))
    )
    kinked = (
        np.any(m.tendon_lengthspring[:, 0] != m.tendon_lengthspring[:, 1]),
        np.any(m.dof_frictionloss),
        np.any(m.tendon_frictionloss),
        np.any(m.jnt_limited),
        np.any(m.tendon_limited),
        np.any(m.jnt_springyield),
        np.any(m.tendon_springyield),
        np.any(m.actuator_ctrllimited),
        np.any(m.actuator_actlimited),
        np.any(m.actuator_forcelimited),
        np.any(m.jnt_actfrclimited),
        np.any(m.tendon_actfrclimited),
        np.any(m.sensor_cutoff),
        contacts,
    )
    return not any(kinked)


def is_straight(model: mujoco.MjModel) -> bool:
    """Whether, kinks aside, forces and readings are linear in position, velocity and control at any amplitude."""
    m = model
    bends = (
        np.any(m.jnt_type != int(mujoco.mjtJoint.mjJNT_SLIDE)),
        np.any(m.wrap_type != int(mujoco.mjtWrap.mjWRAP_JOINT)),
        np.any(m.jnt_stiffnesspoly),
        np.any(m.dof_dampingpoly),
        np.any(m.tendon_stiffnesspoly),
        np.any(m.tendon_dampingpoly),
        np.any(m.actuator_dampingpoly),
        not np.all(np.isin(m.actuator_trntype, (JOINT, TENDON))),
        np.any(m.actuator_gaintype != int(mujoco.mjtGain.mjGAIN_FIXED)),
        np.any(m.actuator_biastype > int(mujoco.mjtBias.mjBIAS_AFFINE)),
        not np.all(np.isin(m.actuator_dyntype, LINEAR_DYNAMICS)),
        m.opt.density or m.opt.viscosity,
        m.opt.disableflags & SWITCHES,
        m.neq,
    )
    return not any(bends)


def tangent(model: mujoco.MjModel, position: Array) -> mujoco.MjModel:
    """A copy of the model without its kinks, equal to it for small motion about the joint positions given.

    Dry friction, limits, contacts and clipping are left out. A spring with a deadband has its stiffness outside the band, none
    inside, and the mean of both on the border.
    """
    m = copy.copy(model)
    bits = mujoco.mjtDisableBit
    m.opt.disableflags |= int(bits.mjDSBL_CONTACT | bits.mjDSBL_LIMIT | bits.mjDSBL_FRICTIONLOSS)
    for limited in (
        m.actuator_ctrllimited,
        m.actuator_actlimited,
        m.actuator_forcelimited,
        m.jnt_actfrclimited,
        m.tendon_actfrclimited,
        m.sensor_cutoff,
    ):
        limited[:] = 0
    low, high = m.tendon_lengthspring.T.copy()
    if np.any(low != high):
        data = mujoco.MjData(m)
        data.qpos[:] = position
        mujoco.mj_fwdPosition(m, data)
        length, near = data.ten_length, 1e-9 * m.stat.extent
        above, below = length - high, low - length
        share = np.where(
            np.maximum(above, below) > near, 1.0, np.where(np.maximum(above, below) < -near, 0.0, 0.5)
        )
        share[low == high] = 1.0
        m.tendon_stiffness[:] *= share
        m.tendon_stiffnesspoly[:] *= share[:, None]
        m.tendon_lengthspring[:] = np.where(above > below, high, low)[:, None]
    return m
