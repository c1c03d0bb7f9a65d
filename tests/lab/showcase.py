"""Small results to be drawn, made from exact linear algebra: structures driven by pulses or noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identification.modes import Modes
from identification.recording import Channel, Record, Recording
from identification.stability import Stabilization
from identification.systems import Realization, SecondOrder, StateSpace
from lab.compare import compare
from lab.result import Criterion, Result
from lab.rig import Rig
from lab.simulate import Motion

MODELS = Path(__file__).parents[2] / "models"
RATE = 20.0


def chain_rig(name: str = "chain3_coupled", **channels) -> Rig:
    return Rig.load(MODELS / f"{name}.xml").connected(**channels)


def pulse_recording(rig: Rig, n_samples: int = 600, *, rate: float = RATE) -> Recording:
    """One record per input, each driven by a unit pulse at the first sample."""
    system = rig.state_space().sampled(1 / rate)
    records = []
    for row in range(len(rig.inputs)):
        u = np.zeros((len(rig.inputs), n_samples))
        u[row, 0] = 1.0
        records.append(Record("pulse", u, system.simulate(u)))
    return Recording(tuple(records), rig.inputs, rig.outputs, rate, title="pulses")


def random_recording(rig: Rig, n_samples: int = 20_000, *, rate: float = RATE, seed: int = 3) -> Recording:
    """One record driven by white noise on every input."""
    u = np.random.default_rng(seed).standard_normal((len(rig.inputs), n_samples))
    system = rig.state_space().sampled(1 / rate)
    return Recording(
        (Record("random", u, system.simulate(u)),), rig.inputs, rig.outputs, rate, title="random"
    )


def motion_of(rig: Rig, recording: Recording) -> Motion:
    """What `lab.simulate.motion` gives, for the first record."""
    truth, n = rig.second_order(), len(rig.dofs)
    B = rig.state_space().B[n:]
    channels = tuple(Channel(dof, "m", dof) for dof in rig.dofs)
    eye, zero = np.eye(n), np.zeros((n, n))
    system = truth.state_space(truth.mass @ B, eye, zero, zero, rig.inputs, channels).sampled(recording.dt)
    u = np.asarray(recording.records[0].inputs[:, :])
    time = np.arange(u.shape[1]) * recording.dt
    return Motion(time, system.simulate(u), u)


def chain_result(
    rig: Rig, *, error: float = 1e-3, title: str = "Three masses, unit pulses", seed: int = 5
) -> Result:
    """The truth with small known errors, beside the truth."""
    rng = np.random.default_rng(seed)
    system = rig.state_space().sampled(1 / RATE)
    truth = rig.modes()
    scatter = np.full(len(truth), error)
    modes = Modes(
        truth.frequency_hz * (1 + error * rng.standard_normal(len(truth))),
        truth.damping_ratio * (1 + 10 * error * rng.standard_normal(len(truth))),
        truth.shapes * (1 + error * rng.standard_normal(truth.shapes.shape)),
        truth.outputs,
        truth.frequency_hz * scatter,
        truth.damping_ratio * 10 * scatter,
    )
    true_matrices = rig.second_order()
    noise = error * rng.standard_normal(true_matrices.mass.shape)
    noise += noise.T
    matrices = SecondOrder(
        true_matrices.mass + noise,
        true_matrices.damping + 0.1 * noise,
        true_matrices.stiffness + 2 * noise,
        true_matrices.dofs,
    )
    comparison = compare(truth, modes, true_matrices, matrices)
    values = np.exp(-np.arange(12.0))
    values[system.n_states :] *= 1e-9
    return Result(
        title=title,
        sample_rate=RATE,
        modes=modes,
        stable=(True,) * len(modes),
        second_order=matrices,
        realization=Realization(
            "era", (system,), values, system.n_states, {"n_rows": 50}, ("order from a clear gap",)
        ),
        stabilization=stabilization(system, modes),
        truth_modes=truth,
        truth_second_order=true_matrices,
        comparison=comparison,
        criteria=(
            Criterion("mass_error", 0.1, comparison.mass_error, True),
            Criterion("mac", 0.9, min(pair.mac for pair in comparison.pairs), True),
        ),
        warnings=("channel acc2 shows 3 % drift",),
        notes=("the method was chosen because every record is a pulse",),
    )


def stabilization(system: StateSpace, modes: Modes, seed: int = 9) -> Stabilization:
    """Poles that stay at every order, and random ones with a reason for their rejection."""
    rng = np.random.default_rng(seed)
    orders, frequency, damping, label, cluster = [], [], [], [], []
    for order in range(system.n_states, 40, 2):
        for i in range(len(modes)):
            orders.append(order)
            frequency.append(modes.frequency_hz[i] * (1 + 1e-3 * rng.standard_normal()))
            damping.append(modes.damping_ratio[i])
            label.append("stable")
            cluster.append(i)
        for _ in range((order - system.n_states) // 2):
            orders.append(order)
            frequency.append(rng.uniform(0, RATE / 2))
            damping.append(rng.uniform(-0.1, 0.5))
            label.append(str(rng.choice(["frequency jumps", "negative damping", "complex shape"])))
            cluster.append(-1)
    shapes = np.ones((len(modes.outputs), len(orders)), dtype=complex)
    return Stabilization(
        np.array(orders),
        np.array(frequency),
        np.array(damping),
        shapes,
        tuple(label),
        np.array(cluster),
        modes,
        1e-3 * modes.frequency_hz,
        np.zeros(len(modes)),
    )
