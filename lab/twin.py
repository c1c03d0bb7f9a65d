"""Twin: the plant of a rig, with every mass, stiffness and damping still free to change."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from identification.recording import DERIVATIVE, Array
from lab import forces, laws, linearize, stages
from lab.errors import RigError
from lab.paths import ORDER, PLAIN, Path
from lab.plant import Law, Plant, Tone
from lab.ports import is_law
from lab.rig import Rig, Spring

FAR = 1e5
"""A deadband that ends beyond this length [m] ends nowhere."""


@dataclass(frozen=True, eq=False)
class Twin:
    """A rig in arrays.

    Attributes:
        plant: as the rig stands.
        bodies: names of the bodies that can move.
        springs: names of the springs.
        masses: part of M that each body brings, (n_bodies, n_dofs, n_dofs).
        body_mass: [kg], (n_bodies,).
        rows: extension of each spring per displacement, (n_springs, n_dofs).
        stiffness, damping: coefficients of each spring, (n_springs,).
    """

    plant: Plant
    bodies: tuple[str, ...]
    springs: tuple[str, ...]
    masses: Array
    body_mass: Array
    rows: Array
    stiffness: Array
    damping: Array

    def changed(self, mass: Array, stiffness: Array, damping: Array) -> Plant:
        """The plant with masses, stiffnesses and dampings multiplied by factors, one per body or spring."""
        return replace(
            self.plant,
            mass=self.plant.mass
            + ((mass - 1) @ self.masses.reshape(mass.size, -1)).reshape(self.plant.mass.shape),
            stiffness=self.plant.stiffness + self._spread(self.stiffness * (stiffness - 1)),
            damping=self.plant.damping + self._spread(self.damping * (damping - 1)),
            spring_stiffness=self.stiffness * stiffness,
            spring_damping=self.damping * damping,
        )

    def _spread(self, coefficients: Array) -> Array:
        return self.rows.T @ (coefficients[:, None] * self.rows)


def twin(rig: Rig) -> Twin:
    """The twin of a rig.

    Raises:
        RigError: the chain has a stage, or the structure a force, that a plant does not know.
    """
    model = rig.model
    M, C_d, K = linearize.matrices(without_laws(model), rig.operating_point, analytic=rig.linear)
    data = mujoco.MjData(model)
    data.qpos[:] = rig.operating_point
    mujoco.mj_forward(model, data)
    rows = spring_rows(rig)
    local = [
        law
        for spring, row in zip(rig.springs, rows, strict=True)
        for law in _spring_laws(rig, data, spring, row)
    ]
    forces, motion = _ports(rig)
    stiffness, damping = _coefficients(rig)
    plant = Plant(
        M,
        C_d,
        K,
        forces,
        *motion,
        rig.inputs,
        rig.outputs,
        (PLAIN,) * len(rig.inputs),
        (PLAIN,) * len(rig.outputs),
        stiffness,
        damping,
        (*local, *_frictions(rig, rows), *_user_laws(rig, rows)),
    )
    return Twin(
        _behind_chain(rig, plant),
        rig.bodies,
        tuple(spring.name for spring in rig.springs),
        *_masses(rig),
        rows,
        stiffness,
        damping,
    )


def without_laws(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy of the model with the linear part of its springs only: what laws add is no part of M, C and K."""
    m = copy.copy(model)
    for polynomial in (m.jnt_stiffnesspoly, m.dof_dampingpoly, m.tendon_stiffnesspoly, m.tendon_dampingpoly):
        polynomial[:] = 0.0
    m.tendon_stiffness[m.tendon_lengthspring[:, 0] < m.tendon_lengthspring[:, 1]] = 0.0
    return m


def spring_rows(rig: Rig) -> Array:
    """Extension of every spring per displacement of each degree of freedom, (n_springs, n_dofs)."""
    m, data = rig.model, mujoco.MjData(rig.model)
    data.qpos[:] = rig.operating_point
    mujoco.mj_forward(m, data)
    J = np.zeros((m.ntendon, m.nv))
    if m.ntendon:
        mujoco.mju_sparse2dense(J, data.ten_J, m.ten_J_rownnz, m.ten_J_rowadr, m.ten_J_colind)
    eye = np.eye(m.nv)
    rows = [eye[m.jnt_dofadr[s.index]] if s.kind == "joint" else J[s.index] for s in rig.springs]
    return np.array(rows).reshape(-1, m.nv)


def movable(model: mujoco.MjModel) -> list[int]:
    """Numbers of the bodies that can move, in the order of `Rig.bodies`."""
    return [i for i in range(1, model.nbody) if model.body_weldid[i] != 0]


def _masses(rig: Rig) -> tuple[Array, Array]:
    """Part of M that each body brings, and its mass."""
    parts, masses = [], []
    for index in movable(rig.model):
        matrices = []
        for factor in (1.0, 2.0):
            m = copy.copy(rig.model)
            m.body_mass[index] *= factor
            m.body_inertia[index] *= factor
            data = mujoco.MjData(m)
            # Constants that MuJoCo derives from masses stay as they were until asked for.
            mujoco.mj_setConst(m, data)
            data.qpos[:] = rig.operating_point
            mujoco.mj_forward(m, data)
            M = np.zeros((m.nv, m.nv))
            mujoco.mj_fullM(m, data, M)
            matrices.append(M)
        parts.append(matrices[1] - matrices[0])
        masses.append(float(rig.model.body_mass[index]))
    n = len(rig.dofs)
    return np.array(parts).reshape(-1, n, n), np.array(masses)


def _coefficients(rig: Rig) -> tuple[Array, Array]:
    """Linear stiffness and damping of every spring; none in a deadband."""
    m = rig.model
    k, c = [], []
    for spring in rig.springs:
        i = spring.index
        if spring.kind == "joint":
            k.append(m.jnt_stiffness[i])
            c.append(m.dof_damping[m.jnt_dofadr[i]])
        else:
            low, high = m.tendon_lengthspring[i]
            k.append(m.tendon_stiffness[i] if low == high else 0.0)
            c.append(m.tendon_damping[i])
    return np.array(k, dtype=float), np.array(c, dtype=float)


def _ports(rig: Rig) -> tuple[Array, tuple[Array, Array, Array]]:
    """Force per input, and readings per displacement, velocity and acceleration."""
    n, system = len(rig.dofs), rig.force_response()
    driven = rig.state_space()
    M = rig.second_order().mass
    if driven.n_states != 2 * n + int(np.sum(rig.model.actuator_actnum[is_law(rig.model)])):
        raise RigError(
            "the model has actuators with dynamics of their own, which a plant does not know; use plain motors"
        )
    forces = M @ driven.B[n : 2 * n]
    motion = [np.zeros((len(rig.outputs), n)) for _ in range(3)]
    for i, channel in enumerate(rig.outputs):
        derivative = DERIVATIVE.get(channel.quantity)
        if derivative is None:
            raise RigError(
                f"output {channel.name!r} is no motion, and a plant knows motion only; disconnect it"
            )
        # A reading of acceleration feels a force at once: D = C_a M⁻¹.
        row = (system.C[i, :n], system.C[i, n : 2 * n], system.D[i] @ M)[derivative]
        motion[derivative][i] = row
    return forces, (motion[0], motion[1], motion[2])


def _spring_laws(rig: Rig, data: mujoco.MjData, spring: Spring, row: Array) -> list[Law]:
    """What a spring does beyond its linear coefficients."""
    m, i, found = rig.model, spring.index, []
    if spring.kind == "joint":
        dof = m.jnt_dofadr[i]
        poly, drag = m.jnt_stiffnesspoly[i], m.dof_dampingpoly[dof]
        at_rest = float(data.qpos[m.jnt_qposadr[i]]) - spring.reference
    else:
        poly, drag = m.tendon_stiffnesspoly[i], m.tendon_dampingpoly[i]
        at_rest = float(data.ten_length[i]) - spring.reference
        low, high = m.tendon_lengthspring[i]
        if low < high:
            k, length = m.tendon_stiffness[i], float(data.ten_length[i])
            if not low <= length <= high:
                raise RigError(
                    f"tendon {spring.name!r} is under load at rest, outside its deadband; a plant cannot hold that"
                )
            if high < FAR:
                found.append(Law(forces.STOP, row, (high - length, k, 1.0)))
            if low > -FAR:
                found.append(Law(forces.STOP, row, (low - length, k, -1.0)))
            if np.any(poly):
                raise RigError(
                    f"tendon {spring.name!r} has a deadband and a polynomial; a plant cannot hold both"
                )
            return found
    if np.any(poly):
        if abs(at_rest) > 1e-9 * max(rig.model.stat.extent, 1e-9):
            raise RigError(
                f"spring {spring.name!r} is not linear and under load at rest; a plant cannot hold that"
            )
        found.append(Law(forces.CUBIC, row, (float(poly[1]), float(poly[0]))))
    if np.any(drag):
        found.append(Law(forces.QUADRATIC, row, (float(drag[0]), float(drag[1]))))
    return found


def _frictions(rig: Rig, rows: Array) -> list[Law]:
    m, eye, found = rig.model, np.eye(len(rig.dofs)), []
    for dof in np.flatnonzero(m.dof_frictionloss):
        found.append(Law(forces.COULOMB, eye[dof], (float(m.dof_frictionloss[dof]), 0.0)))
    for spring, row in zip(rig.springs, rows, strict=True):
        if spring.kind == "tendon" and m.tendon_frictionloss[spring.index]:
            found.append(Law(forces.COULOMB, row, (float(m.tendon_frictionloss[spring.index]), 0.0)))
    return found


def _user_laws(rig: Rig, rows: Array) -> list[Law]:
    m, found = rig.model, []
    for i in np.flatnonzero(is_law(m)):
        kind, _, name = m.actuator(i).name.partition("#")[0].partition("@")
        row = rows[[spring.name for spring in rig.springs].index(name)]
        if kind == laws.HYSTERESIS:
            found.append(Law(forces.BOUC_WEN, row, tuple(float(x) for x in m.actuator_dynprm[i, :2])))
        else:
            found.append(Law(forces.DRIFT, row, (float(m.actuator_biasprm[i, 0]),)))
    return found


def _behind_chain(rig: Rig, plant: Plant) -> Plant:
    """The plant behind the stages of a measurement chain; noise is no part of a plant."""
    chain = rig.chain
    for place, channels, change in (
        ("actuators", rig.inputs, Plant.with_input),
        ("sensors", rig.outputs, Plant.with_output),
    ):
        for i, channel in enumerate(channels):
            path = PLAIN
            for stage in _in_order(chain.for_channel(place, channel.name), place):
                path = _passed(path, stage)
            if path is not PLAIN:
                plant = change(plant, i, **vars(path))
    names = [channel.name for channel in rig.outputs]
    for stage in chain.acquisition:
        if isinstance(stage, stages.BandLimitedLag):
            plant = plant.with_output(
                names.index(stage.channel), band_limited_lag=1 / (2 * np.pi * stage.corner_hz)
            )
        if isinstance(stage, stages.BandLimitedDelay):
            plant = plant.with_output(names.index(stage.channel), band_limited_delay=stage.delay)
    order = list(range(len(names)))
    for a, b in chain.swaps:
        i, j = names.index(a), names.index(b)
        order[i], order[j] = order[j], order[i]
    tones = []
    for stage in chain.disturbances:
        if isinstance(stage, stages.Hum):
            row = np.eye(len(rig.dofs))[rig.dofs.index(stage.channel)]
            sine, cosine = stage.amplitude * np.cos(stage.phase), stage.amplitude * np.sin(stage.phase)
            tones.append(Tone(row, stage.frequency_hz, float(sine), float(cosine)))
    return replace(plant, order=tuple(order) if chain.swaps else (), tones=tuple(tones))


def _in_order(found: tuple[stages.Stage, ...], place: str) -> tuple[stages.Stage, ...]:
    """Stages of one channel, checked to act in the order of a path."""
    names = [stage.name for stage in found]
    for stage in found:
        if stage.name not in ORDER[place]:
            raise RigError(
                f"stage {stage.name!r} on channel {stage.channel!r} is not known to a plant; remove it from the {place}"
            )
    if names != sorted(names, key=ORDER[place].index) or any(
        "lag" in name and names.count(name) > 1 for name in names
    ):
        raise RigError(
            f"channel {found[0].channel!r} passes {', '.join(names)}; a plant knows {', '.join(ORDER[place])}, in this order "
            "and each lag once"
        )
    return found


def _passed(path: Path, stage: stages.Stage) -> Path:
    """The path with one more stage."""
    if isinstance(stage, stages.Gain):
        return replace(path, gain=path.gain * (1 + stage.relative_change))
    if isinstance(stage, stages.Delay):
        return replace(path, delay=path.delay + stage.delay)
    if isinstance(stage, stages.Saturation):
        return replace(path, limit=min(path.limit, stage.limit))
    if isinstance(stage, stages.Lag):
        return replace(path, lag=1 / (2 * np.pi * stage.corner_hz))
    if isinstance(stage, stages.HeldLag):
        return replace(path, held_lag=stage.time_constant)
    assert isinstance(stage, stages.Hum)
    sine, cosine = stage.amplitude * np.cos(stage.phase), stage.amplitude * np.sin(stage.phase)
    return replace(path, hum=(*path.hum, (stage.frequency_hz, float(sine), float(cosine))))
