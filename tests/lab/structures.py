"""Structures whose equations the tests write down themselves, and the exact response to held forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import scipy.linalg

from identification.recording import Array, Recording
from identification.systems import SecondOrder
from lab.rig import Rig
from tests import systems

MODELS = Path(__file__).parents[2] / "models"

# Model, sample rate of its paper [Hz] and the equations as the tests know them.
LINEAR = {
    "chain3_uncoupled": (20.0, systems.chain3("uncoupled")),
    "chain3_coupled": (20.0, systems.chain3("coupled")),
    "chain7": (1 / 0.027, systems.chain7()),
    "truss": (50.0, systems.truss()),
}


def model(name: str) -> Rig:
    """A rig from the folder of models, all channels connected."""
    return Rig.load(MODELS / f"{name}.xml")


def moving(name: str) -> Rig:
    """The same with those outputs only that the structure can move."""
    rig = model(name)
    return rig.connected(outputs=rig.responding)


def chain_xml(
    masses: Sequence[float],
    ground: Sequence[tuple[float, float]],
    joined: Mapping[tuple[int, int], tuple[float, float]],
) -> str:
    """MJCF of masses on parallel rails, sprung to the ground and to each other.

    Args:
        masses: [kg].
        ground: stiffness [N/m] and damping [N s/m] of each mass to the ground.
        joined: the same for pairs of masses, counted from 0.
    """
    bodies, inputs, outputs = "", "", ""
    for i, (mass, (k, c)) in enumerate(zip(masses, ground, strict=True)):
        bodies += f"""
        <body name="mass{i}" pos="{i} 0 0">
          <joint name="q{i}" type="slide" axis="1 0 0" stiffness="{k!r}" damping="{c!r}"/>
          <geom type="box" size="0.1 0.1 0.1" mass="{mass!r}"/><site name="site{i}"/>
        </body>"""
        inputs += f'<motor name="force{i}" joint="q{i}"/>'
        outputs += f'<accelerometer name="acc{i}" site="site{i}"/><jointvel name="vel{i}" joint="q{i}"/>'
        outputs += f'<jointpos name="pos{i}" joint="q{i}"/>'
    springs = "".join(
        f'<fixed name="spring{a}_{b}" stiffness="{k!r}" damping="{c!r}" springlength="0">'
        f'<joint joint="q{a}" coef="-1"/><joint joint="q{b}" coef="1"/></fixed>'
        for (a, b), (k, c) in joined.items()
    )
    tendons = f"<tendon>{springs}</tendon>" if springs else ""
    return f"""<mujoco model="chain"><option gravity="0 0 0"><flag contact="disable"/></option>
    <worldbody>{bodies}</worldbody>{tendons}
    <actuator>{inputs}</actuator><sensor>{outputs}</sensor></mujoco>"""


def chain_matrices(
    masses: Sequence[float],
    ground: Sequence[tuple[float, float]],
    joined: Mapping[tuple[int, int], tuple[float, float]],
) -> tuple[Array, Array, Array]:
    """M, C_d, K of `chain_xml`, spring by spring."""
    n = len(masses)
    K_and_C = []
    for which in (0, 1):
        X = np.diag([element[which] for element in ground]).astype(float)
        for (a, b), element in joined.items():
            e = np.zeros(n)
            e[a], e[b] = -1, 1
            X += element[which] * np.outer(e, e)
        K_and_C.append(X)
    return np.diag(masses).astype(float), K_and_C[1], K_and_C[0]


def oscillator(
    *, mass: float = 2.0, stiffness: float = 50.0, damping: float = 0.4, extra: str = "", option: str = ""
) -> str:
    """MJCF of one mass on a spring along x, with a force, a position, a velocity and an accelerometer."""
    return f"""<mujoco model="oscillator"><option gravity="0 0 0" {option}><flag contact="disable"/></option>
    <worldbody><body name="mass"><joint name="x" type="slide" axis="1 0 0" stiffness="{stiffness!r}" damping="{damping!r}"/>
    <geom type="box" size="0.1 0.1 0.1" mass="{mass!r}"/><site name="top"/></body></worldbody>
    <actuator><motor name="force" joint="x"/></actuator>
    <sensor><jointpos name="pos" joint="x"/><jointvel name="vel" joint="x"/>
    <accelerometer name="acc" site="top"/></sensor>{extra}</mujoco>"""


def held_response(
    structure: SecondOrder,
    channels: Sequence,
    dt: float,
    forces: Array,
    start: tuple[Array, Array] | None = None,
) -> Array:
    """Exact response of M q̈ + C q̇ + K q = f to forces held over each sample, shape (n_channels, n_samples).

    Written on its own, from M, C, K alone: nothing of the library takes part.

    Args:
        structure: M, C, K and the names of the degrees of freedom.
        channels: output channels; each one reads one degree of freedom.
        dt: sample time [s].
        forces: on the degrees of freedom, shape (n_dofs, n_samples).
        start: displacement and velocity at the first sample; rest when None.
    """
    M, C_d, K = structure.mass, structure.damping, structure.stiffness
    n = M.shape[0]
    F = np.zeros((3 * n, 3 * n))  # q, q̇ and the held force
    F[:n, n : 2 * n] = np.eye(n)
    F[n : 2 * n] = np.linalg.solve(M, np.hstack([-K, -C_d, np.eye(n)]))
    step = scipy.linalg.expm(F * dt)
    x = np.zeros(2 * n) if start is None else np.concatenate(start)
    y = np.empty((len(channels), forces.shape[1]))
    rows = [structure.dofs.index(channel.dof) for channel in channels]
    slots = [{"displacement": 0, "velocity": 1, "acceleration": 2}[channel.quantity] for channel in channels]
    factors = [channel.factor for channel in channels]
    for k in range(forces.shape[1]):
        full = np.concatenate([x, forces[:, k]])
        motion = np.stack([x[:n], x[n:], F[n : 2 * n] @ full])
        y[:, k] = factors * motion[slots, rows]
        x = (step @ full)[: 2 * n]
    return y


def on_dofs(structure: SecondOrder, channels: Sequence, inputs: Array) -> Array:
    """Forces on the degrees of freedom, shape (n_dofs, n_samples), of input signals (n_inputs, n_samples)."""
    forces = np.zeros((len(structure.dofs), inputs.shape[1]))
    for channel, signal in zip(channels, inputs, strict=True):
        forces[structure.dofs.index(channel.dof)] += channel.factor * signal
    return forces


def true_error(recording: Recording, structure: SecondOrder) -> float:
    """Largest difference to the exact held response, per record and channel over its largest value, at worst."""
    worst = 0.0
    for record in recording.records:
        forces = on_dofs(structure, recording.inputs, np.asarray(record.inputs))
        exact = held_response(structure, recording.outputs, recording.dt, forces)
        errors = np.max(np.abs(record.outputs - exact), axis=1) / np.max(np.abs(exact), axis=1)
        worst = max(worst, float(np.max(errors)))
    return worst
