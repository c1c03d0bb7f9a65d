"""What other signals and levels would tell about the modes, through the sensors and actuators chosen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from identification.information import cramer_rao_bound, planned
from identification.recording import DERIVATIVE, Array
from identification.systems import StateSpace
from lab.placement.candidates import force_columns, motion_rows
from lab.placement.outcome import Drive
from lab.placement.plan import Plan, alternatives, peak, total_duration
from lab.placement.shapes import normal_modes
from lab.rig import Rig

MEASURE = "root mean square over the modes of the least relative standard deviation of their frequencies"
MAX_PARAMETERS = 1000
"""Poles, shapes and participations: beyond, one signal alone takes seconds."""


def modal_drives(
    rig: Rig, plan: Plan, outputs: Sequence[int], inputs: Sequence[int], n_modes: int
) -> Iterator[Drive]:
    """Signals and levels with what each tells about the frequencies of the lowest modes, all else unknown too.

    Args:
        rig: with every candidate channel connected.
        plan: the test; the noise that it has with the planned signal is that of all.
        outputs, inputs: positions of the channels chosen.
        n_modes: lowest modes, of which alone there is response.

    Yields:
        One drive after another; none where there are more than `MAX_PARAMETERS` unknowns.
    """
    unknown = 2 * n_modes * (1 + len(outputs) + len(inputs)) + len(outputs) * len(inputs)
    if unknown > MAX_PARAMETERS:
        return
    inputs = list(inputs)
    system = modal_system(rig, outputs, inputs, n_modes)
    std = _noise_std(plan, system, [u[inputs] for _, u in plan.signals(rig, inputs)])
    if not np.all(felt := np.isfinite(std)):
        outputs, std = [i for i, is_felt in zip(outputs, felt, strict=True) if is_felt], std[felt]
        system = modal_system(rig, outputs, inputs, n_modes)
    omega = np.sort(np.abs(np.linalg.eigvals(system.A)))[::2]
    for name, other in alternatives(rig, plan, omega / (2 * np.pi), inputs):
        signals = [(kind, u[inputs]) for kind, u in other.signals(rig, inputs)]
        test = planned([u for _, u in signals], system.inputs, system.outputs, sample_rate=plan.sample_rate)
        modes = cramer_rao_bound(system, test, noise_std=std).modes
        assert modes.frequency_std is not None
        figure = float(np.sqrt(np.mean((modes.frequency_std / modes.frequency_hz) ** 2)))
        yield Drive(name, total_duration(signals, other.sample_rate), peak(signals), figure)


def modal_system(rig: Rig, outputs: Sequence[int], inputs: Sequence[int], n_modes: int) -> StateSpace:
    """The structure in its lowest flexible modes alone, seen and driven through these channels.

    Args:
        rig: structure.
        outputs, inputs: positions of channels.
        n_modes: modes kept.

    Returns:
        A continuous state space; states are modal coordinates and their rates.
    """
    omega, shapes = (x[..., :n_modes] for x in normal_modes(rig))
    stiffness, damping = np.diag(omega**2), shapes.T @ rig.second_order().damping @ shapes
    forces = shapes.T @ force_columns(rig)[:, list(inputs)]
    rows = motion_rows(rig)[list(outputs)] @ shapes
    channels = [rig.outputs[i] for i in outputs]
    each = np.array([DERIVATIVE[channel.quantity] for channel in channels])
    C_p, C_v, C_a = (rows * (each == k)[:, None] for k in range(3))
    zero = np.zeros((n_modes, n_modes))
    return StateSpace(
        np.block([[zero, np.eye(n_modes)], [-stiffness, -damping]]),
        np.vstack([np.zeros_like(forces), forces]),
        np.hstack([C_p - C_a @ stiffness, C_v - C_a @ damping]),
        C_a @ forces,
        0.0,
        tuple(rig.inputs[i] for i in inputs),
        tuple(channels),
    )


def _noise_std(plan: Plan, system: StateSpace, signals: Sequence[Array]) -> Array:
    """Noise of each output in the planned test, shape (n_outputs,); infinite where nothing is felt."""
    sampled = system.sampled(1 / plan.sample_rate)
    power = [np.mean(sampled.simulate(u) ** 2, axis=1) for u in signals]
    return plan.noise_std(system.outputs, np.sqrt(np.mean(power, axis=0))[None])[0]
