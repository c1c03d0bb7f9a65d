"""Time steps: MuJoCo's RK4 over a batch of records, with the substeps that an accuracy needs.

A step of RK4 with substep h errs by a multiple of (ω h)⁴, ω the highest natural frequency; runs with h, 2 h and 4 h
extrapolated twice (Richardson) leave (ω h)⁶. The multiples below were measured on the models of this project and only
start the search: the error is always measured, against a run with half the substep.
"""

from __future__ import annotations

import copy
import itertools
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import rollout

from identification.recording import Array
from lab import laws, mjcf
from lab.errors import DivergedError
from lab.rig import Rig
from lab.stages import Delay

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
CONTROL = mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED
CHUNK_BYTES = 32 << 20
"""Memory for the substeps that are under way at a time."""
LOOSE = 1e-3
"""Error from which on plain steps reach it with fewer substeps than three runs to extrapolate from must have."""


@dataclass(frozen=True)
class Plan:
    """How finely to step.

    Attributes:
        substeps: per sample.
        cancelled: powers of the substep that are cancelled in the error, by runs of a half and a quarter as many.
        error: measured error of the response relative to its largest value, per channel at worst.
    """

    substeps: int
    cancelled: tuple[int, ...] = ()
    error: float = float("nan")

    @property
    def runs(self) -> tuple[int, ...]:
        """Substeps of every run that the result is combined from, finest first."""
        return tuple(self.substeps >> halvings for halvings in range(len(self.cancelled) + 1))

    def combined(self, values: Sequence[Array]) -> Array:
        """The result of all runs, finest first, the powers in `cancelled` gone from its error."""
        table = list(values)
        for order in self.cancelled:
            table = [
                (2**order * fine - coarse) / (2**order - 1) for fine, coarse in itertools.pairwise(table)
            ]
        return table[0]


def cancellable(rig: Rig, dt: float) -> tuple[int, ...]:
    """Powers of the substep that extrapolation can cancel; none where forces have kinks.

    Instruments with a memory see straight lines between substeps, whose error goes with h². So they do as long as jumps of
    the force stay between substeps, which a delay by a part of a sample would upset.
    """
    if not rig.smooth:
        return ()
    if not rig.chain.needs_substeps:
        return (4, 5)
    in_samples = np.array(delays(rig)) / dt
    return (2, 4) if np.all(np.abs(in_samples - np.round(in_samples)) < 1e-9) else ()


def order_left(rig: Rig, plan: Plan) -> int:
    """The power of the substep with which the error of a plan falls."""
    if plan.cancelled:
        return plan.cancelled[-1] + 1
    return 4 if rig.smooth and not rig.chain.needs_substeps else 2


def delays(rig: Rig) -> list[float]:
    """Delays [s] that actuators and sensors of the chain put between instants."""
    return [s.delay for s in (*rig.chain.actuators, *rig.chain.sensors) if isinstance(s, Delay)]


def first_guess(rig: Rig, dt: float, accuracy: float, duration: float) -> Plan:
    """A plan from theory.

    Args:
        rig: the rig.
        dt: sample time [s].
        accuracy: relative error wanted.
        duration: of the record [s].
    """
    phase = highest_frequency(rig) * dt
    at_least = max(int(np.ceil(phase / 2)), 1)
    plain = max(at_least, int(np.ceil(phase * (0.15 / accuracy) ** (1 / 4))))
    cancelled = cancellable(rig, dt)
    if not cancelled or accuracy >= LOOSE or (plain <= 16 and not rig.chain.needs_substeps):
        return aligned(Plan(plain), dt, delays(rig))
    # The coarsest of the three runs must still be stable, and not out of phase by more than a tenth of a radian.
    turns = phase * min(duration, settling_time(rig)) / dt
    in_phase = phase * (turns / 120 / 0.1) ** (1 / 4)
    fine = max(4 * at_least, 4 * int(np.ceil(in_phase)), int(np.ceil(phase * (0.1 / accuracy) ** (1 / 6))))
    return Plan(4 * -(-fine // 4), cancelled)


def finer(rig: Rig, dt: float, plan: Plan, accuracy: float, finest: int) -> Plan:
    """A plan with the substeps that the measured error calls for, at most eight times as many, and at most `finest`."""
    factor = min(max(1.1 * (plan.error / accuracy) ** (1 / order_left(rig, plan)), 1.15), 8.0)
    finer_plan = Plan(min(4 * int(np.ceil(plan.substeps * factor / 4)), finest), plan.cancelled)
    return finer_plan if plan.cancelled else aligned(finer_plan, dt, delays(rig))


def doubled(plan: Plan) -> Plan:
    """The plan with twice the substeps, to measure the error of `plan`."""
    return Plan(2 * plan.substeps, plan.cancelled)


def aligned(plan: Plan, dt: float, shifts: Sequence[float]) -> Plan:
    """The plan with up to twice the substeps, so that delays [s] come as close to whole substeps as they can."""
    if not shifts:
        return plan
    counts = np.arange(plan.substeps, 2 * plan.substeps + 16)
    in_substeps = np.multiply.outer(counts / dt, np.asarray(shifts))
    away = np.max(np.abs(in_substeps - np.round(in_substeps)), axis=1)
    best = int(np.flatnonzero(away <= np.min(away) + 1e-9)[0])
    return Plan(int(counts[best]), plan.cancelled)


def highest_frequency(rig: Rig) -> float:
    """Largest |λ| of the structure about its operating point [rad/s]."""
    return float(np.max(np.abs(np.linalg.eigvals(rig.state_space().A)), initial=0.0))


def settling_time(rig: Rig) -> float:
    """Time [s] over which the error of the steps builds up: the decay time of the mode that errs most.

    The error of a mode λ grows like t λ (λ h)⁴ while its motion decays like exp(Re λ t).
    """
    poles = np.linalg.eigvals(rig.state_space().A)
    decay = np.maximum(-poles.real, 1e-12 * np.abs(poles))
    moving = np.abs(poles) > 0
    if not moving.any():
        return 0.0
    return float(1 / decay[moving][np.argmax((np.abs(poles) ** 5 / np.where(moving, decay, 1.0))[moving])])


class Stepper:
    """Advances a batch of copies of one structure, substep by substep, on all cores.

    Copies do not know of each other, so results do not depend on the number of threads.
    """

    def __init__(
        self, rig: Rig, dt: float, substeps: int, position: Array, velocity: Array, duration: float
    ) -> None:
        """Place every copy at its start.

        Args:
            rig: the structure.
            dt: sample time [s].
            substeps: per sample.
            position: from the operating point, shape (n_batch, n_dofs).
            velocity: shape (n_batch, n_dofs).
            duration: of the record [s], for springs that drift over it.
        """
        self.rig, self.substeps, self.n_batch = rig, substeps, position.shape[0]
        model = copy.copy(rig.model)
        model.opt.timestep = dt / substeps
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        # A solver that starts from what another copy or an earlier chunk left would make results depend on them.
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
        # The exact filter is one of Euler's steps; for Runge and Kutta it is a filter like others.
        model.actuator_dyntype[model.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_FILTEREXACT)] = int(
            mujoco.mjtDyn.mjDYN_FILTER
        )
        laws.set_duration(model, duration)
        _stiffen_friction(model)
        self._model = model
        self._data = [mujoco.MjData(model) for _ in range(min(os.cpu_count() or 1, self.n_batch))]
        self._states = np.zeros((self.n_batch, mujoco.mj_stateSize(model, STATE)))
        n = model.nv
        self._states[:, 1 : 1 + n] = rig.operating_point + position
        self._states[:, 1 + n : 1 + 2 * n] = velocity
        self._rest = readings_at_rest(rig)
        width = self._states.shape[1] + model.nsensordata + model.nu + n
        self.samples_per_chunk = max(1, CHUNK_BYTES // (8 * width * substeps * self.n_batch))

    def advance(self, controls: Array, forces: Array | None) -> tuple[Array, Array]:
        """Readings and positions at the start of every substep, and moves on.

        Args:
            controls: shape (n_batch, n_controls, n_substeps).
            forces: on the degrees of freedom, shape (n_batch, n_dofs, n_substeps), or None.

        Returns:
            sensordata less its value at rest, shape (n_batch, n_sensordata, n_substeps), and displacement from the
            operating point, shape (n_batch, n_dofs, n_substeps).

        Raises:
            DivergedError: the state is no longer finite.
        """
        m, n_steps = self._model, controls.shape[-1]
        if forces is None:
            forces = np.zeros((self.n_batch, m.nv, n_steps))
        control = np.ascontiguousarray(np.concatenate([controls, forces], axis=1).transpose(0, 2, 1))
        with laws.acting(m), mjcf.quiet() as complaints, rollout.Rollout(nthread=len(self._data)) as pool:
            states, sensordata = pool.rollout(
                m, self._data, self._states, control, control_spec=int(CONTROL), chunk_size=1
            )
        self._check(states, complaints)
        n = m.nv
        positions = np.concatenate([self._states[:, None, 1 : 1 + n], states[:, :-1, 1 : 1 + n]], axis=1)
        self._states = states[:, -1].copy()
        return (
            sensordata.transpose(0, 2, 1) - self._rest[:, None],
            positions.transpose(0, 2, 1) - self.rig.operating_point[:, None],
        )

    def _check(self, states: Array, complaints: list[str]) -> None:
        # MuJoCo resets a diverged state to its start: its clock runs backwards then.
        clock = states[:, :, 0]
        previous = np.concatenate([self._states[:, :1], clock[:, :-1]], axis=1)
        broken = ~(clock > previous).all(axis=0) | ~np.isfinite(states).all(axis=(0, 2))
        if not broken.any():
            return
        time = float(np.max(previous[:, int(np.argmax(broken))]))
        dof = re.search(r"DOF (\d+)", complaints[0]) if complaints else None
        where = f" at degree of freedom {self.rig.dofs[int(dof[1])]!r}" if dof else ""
        raise DivergedError(
            f"the simulation of {self.rig.name!r} diverged near t = {time:.4g} s{where}; check for negative stiffness or "
            "damping, lower the force, or ask for more accuracy"
        )


def readings_at_rest(rig: Rig) -> Array:
    """What every sensor reads at the operating point, shape (n_sensordata,); instruments are zeroed there."""
    data = mujoco.MjData(rig.model)
    data.qpos[:] = rig.operating_point
    mujoco.mj_forward(rig.model, data)
    # What moves by rounding only is at rest: keep exact zeros exact.
    return np.where(np.abs(data.sensordata) < 1e-13, 0.0, data.sensordata)


def _stiffen_friction(model: mujoco.MjModel) -> None:
    """Lets dry friction stick within two substeps, as hard as MuJoCo's soft constraints go; the error is O(h)."""
    reference, impedance = [2 * model.opt.timestep, 1.0], [0.9999, 0.9999, 0.001]
    for solref, solimp in (
        (model.dof_solref, model.dof_solimp),
        (model.tendon_solref_fri, model.tendon_solimp_fri),
    ):
        solref[:], solimp[:, :3] = reference, impedance
