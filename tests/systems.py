"""Systems whose truth is known exactly, and the recordings that they would give, in numpy alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.recording import DERIVATIVE, Array, Channel, Record, Recording
from identification.systems import SecondOrder, StateSpace

MOTION_UNITS = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}


def chain3(damping: str = "uncoupled") -> SecondOrder:
    """Three masses joined pairwise and to the ground: De Angelis et al. (2002), Tables 1 and 2."""
    # Each pair, then each mass to ground: 1-2, 1-3, 2-3, 1, 2, 3.
    springs = (1.0, 1.0, 1.0, 2.0, 2.0, 2.0)
    dashpots = {"uncoupled": (0.1, 0.1, 0.1, 0.2, 0.2, 0.2), "coupled": (0.1, 0.2, 0.3, 0.2, 0.3, 0.1)}
    return SecondOrder(
        np.diag([0.8, 2.0, 1.2]), _triangle(dashpots[damping]), _triangle(springs), ("x1", "x2", "x3")
    )


def _triangle(elements: Sequence[float]) -> Array:
    """Matrix of three points joined pairwise and to the ground."""
    a12, a13, a23, *ground = elements
    off = -np.array([[0, a12, a13], [a12, 0, a23], [a13, a23, 0]])
    return off + np.diag(np.array(ground) - off.sum(axis=1))


def truss() -> SecondOrder:
    """Three X-braced unit bays between fixed end nodes: De Angelis et al. (2002), Fig. 2 and Table 8.

    The free nodes are 1 lower left, 2 upper left, 3 lower right, 4 upper right of the middle bay.
    """
    position = {
        1: (1, 0), 2: (1, 1), 3: (2, 0), 4: (2, 1),
        5: (0, 0), 6: (0, 1), 7: (3, 0), 8: (3, 1),
    }  # fmt: skip
    bars = [
        (5, 1), (1, 3), (3, 7), (6, 2), (2, 4), (4, 8),  # chords
        (1, 2), (3, 4),  # verticals
        (5, 2), (6, 1), (1, 4), (2, 3), (3, 8), (4, 7),  # diagonals
    ]  # fmt: skip
    K = np.zeros((16, 16))
    for a, b in bars:
        span = np.subtract(position[b], position[a]).astype(float)
        length = np.hypot(*span)
        k = 10_000 / length * np.outer(span, span) / length**2
        i, j = slice(2 * a - 2, 2 * a), slice(2 * b - 2, 2 * b)
        K[i, i] += k
        K[j, j] += k
        K[i, j] -= k
        K[j, i] -= k
    K = K[:8, :8]
    M = 100 * np.eye(8)
    return SecondOrder(M, 0.01 * M + 0.005 * K, K, ("u1", "v1", "u2", "v2", "u3", "v3", "u4", "v4"))


def chain7(stiffness: float = 2500.0, damping: float = 2.5) -> SecondOrder:
    """Seven masses of 1 kg in a chain fixed at one end: Cambraia and Kurka (2010), Fig. 1, corrected."""
    shape = 2 * np.eye(7) - np.eye(7, k=1) - np.eye(7, k=-1)
    shape[-1, -1] = 1
    return SecondOrder(np.eye(7), damping * shape, stiffness * shape, tuple(f"x{i}" for i in range(1, 8)))


def modes4(damping: Sequence[float] = (0.0499, 0.0022, 0.0022, 0.0025)) -> StateSpace:
    """Two of four modes nearly alike, sampled at 128 Hz: Juang (1992), eq. (6.1), (6.2) and (C.2) to (C.4).

    Args:
        damping: ratio of each mode; the default is Table 2 read from the bottom, which is what the printed
            singular values belong to.
    """
    dt = 1 / 128
    omega = 2 * np.pi * np.array([1.0, 9.0, 9.003, 20.0])  # damped frequencies
    zeta = np.asarray(damping)
    sigma = -zeta * omega / np.sqrt(1 - zeta**2)
    A = np.zeros((8, 8))
    for k, z in enumerate(np.exp((sigma + 1j * omega) * dt)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[z.real, -z.imag], [z.imag, z.real]]
    C = np.zeros((4, 8))
    C[:, ::2] = [[1, 2, 2.002, 3], [2, 3, 3.003, 4], [1, 3, 3.003, 4], [0, 2, 2.002, 4]]
    size = np.array([1.0, 3.0, 3.5, 4.0])
    angle = np.pi * (np.array([0, 1 / 3, 0, 1 / 4]) + np.array([1 / 4, 1, 1 / 3, 0]))
    B = np.stack([2 * size * np.cos(angle), 2 * size * np.sin(angle)], axis=1).reshape(8, 1)
    outputs = tuple(Channel(f"y{i}", "m/s^2") for i in range(1, 5))
    return StateSpace(A, B, C, np.zeros((4, 1)), dt, (Channel("u", "N"),), outputs)


def sensors(
    dofs: Sequence[str], quantity: str = "acceleration", *, factor: float = 1.0
) -> tuple[Channel, ...]:
    """One output channel on each degree of freedom."""
    return tuple(Channel(f"{quantity}_{dof}", MOTION_UNITS[quantity], dof, factor) for dof in dofs)


def actuators(dofs: Sequence[str], *, factor: float = 1.0) -> tuple[Channel, ...]:
    """One force channel on each degree of freedom."""
    return tuple(Channel(f"force_{dof}", "N", dof, factor) for dof in dofs)


def instrumented(structure: SecondOrder, outputs: Sequence[Channel], inputs: Sequence[Channel]) -> StateSpace:
    """Continuous model of the structure with these sensors and actuators."""
    n = len(structure.dofs)
    B = np.zeros((n, len(inputs)))
    for j, channel in enumerate(inputs):
        B[structure.dofs.index(channel.dof), j] = channel.factor
    C = np.zeros((3, len(outputs), n))
    for i, channel in enumerate(outputs):
        C[DERIVATIVE[channel.quantity], i, structure.dofs.index(channel.dof)] = channel.factor
    return structure.state_space(B, C[0], C[1], C[2], tuple(inputs), tuple(outputs))


def paper_chain3(damping: str = "uncoupled") -> StateSpace:
    """De Angelis et al. (2002), 5.1 and 5.2, sampled: accelerations 2 and 3, forces 1 and 2."""
    system = instrumented(chain3(damping), sensors(("x2", "x3")), actuators(("x1", "x2")))
    return system.sampled(0.05)


def paper_truss(dt: float = 0.02) -> StateSpace:
    """De Angelis et al. (2002), 5.4, sampled: five accelerometers and four forces.

    The text names v4 as the fifth sensor, which would leave u4 without any; eq. (24) uses row 7, which is u4.
    """
    system = instrumented(
        truss(), sensors(("u1", "v1", "v2", "v3", "u4")), actuators(("v1", "u2", "u3", "v4"))
    )
    return system.sampled(dt)


def recorded(
    system: StateSpace,
    inputs: Sequence[Array],
    *,
    kind: str = "random",
    initial: Sequence[Array] | None = None,
) -> Recording:
    """What a sampled system gives under each of several input signals, from rest or from initial states."""
    starts = [np.zeros(system.n_states)] * len(inputs) if initial is None else initial
    records = [
        Record(kind, u, system.simulate(np.asarray(u), x0)) for u, x0 in zip(inputs, starts, strict=True)
    ]
    return Recording(tuple(records), system.inputs, system.outputs, 1 / system.dt)


def pulse_recording(system: StateSpace, n_samples: int, *, height: float = 1.0) -> Recording:
    """One record per input: a force held over the first sample."""
    inputs = []
    for j in range(len(system.inputs)):
        u = np.zeros((len(system.inputs), n_samples))
        u[j, 0] = height
        inputs.append(u)
    return recorded(system, inputs, kind="pulse")


def noisy(values: Array, level: float, rng: np.random.Generator) -> Array:
    """The values with white noise of `level` times the RMS of each row (the last axis counts samples)."""
    rms = np.sqrt(np.mean(np.square(values), axis=-1, keepdims=True))
    return values + level * rms * rng.standard_normal(values.shape)


def with_noise(recording: Recording, level: float, seed: int | np.random.Generator) -> Recording:
    """The recording with such noise on its outputs."""
    rng = np.random.default_rng(seed)
    records = (replace(r, outputs=noisy(np.asarray(r.outputs), level, rng)) for r in recording.records)
    return replace(recording, records=tuple(records))
