"""Transition: what a plant does over a substep, as the matrices of the kernel."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy.linalg

from identification.recording import Array
from lab.forces import COULOMB
from lab.plant import Law, Plant

Changes = dict[int, tuple[int, float]]
"""For each input column that acts after the force of a late actuator changes within a sample: the column that acts before,
and when it changes [s]."""


def transition_of(plant: Plant, dt: float, sub: int) -> tuple[Array, ...]:
    """Matrices of the kernel, F, G, P, Q, X, V, S, T, R, at, C, D and E, for a sample of `dt` [s] in `sub` substeps.

    They are made once for laws of every size.
    """
    return _made(_Asked(plant, dt, sub))


class _Asked:
    """A plant, as far as its transition depends on it: laws of other sizes at the same place share one."""

    def __init__(self, plant: Plant, dt: float, sub: int) -> None:
        self.plant, self.dt, self.sub = plant, dt, sub
        structure = (plant.mass, plant.damping, plant.stiffness, plant.forces)
        readings = (plant.displacement, plant.velocity, plant.acceleration)
        self.key = (
            *(dt, sub, len(plant.tones)),
            *(array.tobytes() for array in (*structure, *readings)),
            *((law.row.tobytes(), _dry(law)) for law in plant.laws),
            *(tone.row.tobytes() for tone in plant.tones),
            *((path.lag, path.delay) for path in (*plant.input_paths, *plant.output_paths)),
        )

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Asked) and self.key == other.key


def _dry(law: Law) -> bool:
    """Whether a law is dry friction, which jumps."""
    return law.kind == COULOMB and not law.parameters[1]


@lru_cache(maxsize=16)
def _made(asked: _Asked) -> tuple[Array, ...]:
    """The linear part in states q, q̇, then one value per lagging input and per lagging output."""
    plant, dt, sub = asked.plant, asked.dt, asked.sub
    n, n_in, n_out = plant.n_dofs, len(plant.inputs), len(plant.outputs)
    rows = np.array([law.row for law in plant.laws]).reshape(-1, n)
    tones = np.array([tone.row for tone in plant.tones]).reshape(-1, n)
    # Accelerations from displacement, velocity, inputs, tones and laws.
    forces = (-plant.stiffness, -plant.damping, plant.forces, tones.T, -rows.T)
    moved = np.linalg.solve(plant.mass, np.concatenate(forces, axis=1))
    from_q, from_v, from_u = moved[:, :n], moved[:, n : 2 * n], moved[:, 2 * n : 2 * n + n_in]
    from_t, from_g = moved[:, 2 * n + n_in :][:, : len(tones)], moved[:, 2 * n + n_in + len(tones) :]
    lagging_in = [i for i, path in enumerate(plant.input_paths) if path.lag]
    lagging_out = [i for i, path in enumerate(plant.output_paths) if path.lag]
    late = [i for i, path in enumerate(plant.input_paths) if path.delay and path.parts(dt)[1]]
    a, b = 2 * n + len(lagging_in), 2 * n + len(lagging_in) + len(lagging_out)
    n_u = n_in + len(late) + len(tones)
    A, B, W = np.zeros((b, b)), np.zeros((b, n_u)), np.zeros((b, len(rows)))
    np.fill_diagonal(A[:n, n : 2 * n], 1.0)
    A[n : 2 * n, :n], A[n : 2 * n, n : 2 * n] = from_q, from_v
    B[n : 2 * n] = np.concatenate([from_u, from_u[:, late], from_t], axis=1)
    W[n : 2 * n] = from_g
    # Every column of inputs belongs to a channel; a late one has two, before and after its force changes.
    columns = [*range(n_in), *late]
    for slot, i in enumerate(lagging_in, start=2 * n):
        rate, own = 1 / plant.input_paths[i].lag, [j for j, channel in enumerate(columns) if channel == i]
        A[n : 2 * n, slot], A[slot, slot] = from_u[:, i], -rate
        B[n : 2 * n, own], B[slot, own] = 0.0, rate
    motion = np.zeros((n_out, b))
    motion[:, :n], motion[:, n : 2 * n] = plant.displacement, plant.velocity
    C = motion + plant.acceleration @ A[n : 2 * n]
    D, E = plant.acceleration @ B[n : 2 * n], plant.acceleration @ W[n : 2 * n]
    for slot, i in enumerate(lagging_out, start=a):
        rate = 1 / plant.output_paths[i].lag
        A[slot], B[slot], W[slot] = rate * C[i], rate * D[i], rate * E[i]
        A[slot, slot] -= rate
        C[i], D[i], E[i] = np.eye(b)[slot], 0.0, 0.0
    changes = {n_in + j: (i, plant.input_paths[i].parts(dt)[1] * dt) for j, i in enumerate(late)}
    F, held, P, Q = _over_a_substep(A, B, W, dt / sub)
    G = np.stack(
        [_inputs_over(A, B, step * dt / sub, dt / sub, changes) if changes else held for step in range(sub)]
    )
    dry = [i for i, law in enumerate(plant.laws) if _dry(law)]
    Q[:, dry] += P[:, dry]
    P[:, dry] = 0.0
    X, V = np.zeros((len(rows), b)), np.zeros((len(rows), b))
    X[:, :n], V[:, n : 2 * n] = rows, rows
    S, T, R = V @ A, V @ _acting(B, 0.0, changes), V @ W
    at, C, D, E = _late_readings(plant, dt, sub, A, B, W, C, D, E, changes)
    return tuple(np.ascontiguousarray(m) for m in (F, G, P, Q, X, V, S, T, R, at, C, D, E))


def _late_readings(
    plant: Plant,
    dt: float,
    sub: int,
    A: Array,
    B: Array,
    W: Array,
    C: Array,
    D: Array,
    E: Array,
    changes: Changes,
) -> tuple[np.ndarray, Array, Array, Array]:
    """Readings of delayed outputs part of a sample after each instant, so that whole samples make up their delay.

    Each is taken from the start of the last substep before it.
    """
    at = np.zeros(len(C), dtype=np.int64)
    delayed = [i for i, path in enumerate(plant.output_paths) if path.delay]
    if not (delayed or changes):
        return at, C, D, E
    both, C, D, E = D, C.copy(), _acting(D, 0.0, changes), E.copy()
    for i in delayed:
        ahead = (1 - plant.output_paths[i].parts(dt)[1]) * dt
        if ahead < dt:
            at[i] = min(int(ahead / dt * sub + 1e-9), sub - 1)
            start = at[i] * dt / sub
            left = max(ahead - start, 0.0)
            F, _, P, Q = _over_a_substep(A, B, W, left)
            G = _inputs_over(A, B, start, left, changes)
            D[i] = C[i] @ G + _acting(both[[i]], ahead, changes)[0]
            C[i], E[i] = C[i] @ F, C[i] @ (P + Q) + E[i]
    return at, C, D, E


def _acting(columns: Array, t: float, changes: Changes) -> Array:
    """Effect of inputs at a time t within a sample: of a late one, before or after its force changes."""
    columns = columns.copy()
    for after, (before, change) in changes.items():
        columns[:, before if t >= change else after] = 0.0
    return columns


def _inputs_over(A: Array, B: Array, start: float, h: float, changes: Changes) -> Array:
    """Transition of held inputs over h from a start within a sample."""
    none = np.zeros((A.shape[0], 0))
    G = _over_a_substep(A, B, none, h)[1]
    for after, (before, change) in changes.items():
        left = min(max(start + h - change, 0.0), h)
        G[:, after] = _over_a_substep(A, B[:, [after]], none, left)[1][:, 0]
        G[:, before] -= G[:, after]
    return G


def _over_a_substep(A: Array, B: Array, W: Array, h: float) -> tuple[Array, Array, Array, Array]:
    """Transition over h: state, held inputs, and forces that fall from one to zero and rise from zero to one."""
    b, m, e = A.shape[0], B.shape[1], W.shape[1]
    block = np.zeros((b + m + 2 * e, b + m + 2 * e))
    block[:b, :b], block[:b, b : b + m] = A * h, B * h
    block[:b, b + m : b + m + e] = W * h
    block[b + m : b + m + e, b + m + e :] = np.eye(e)
    # A trial far from any sense may overflow: its response is not finite, and no fit goes there.
    with np.errstate(over="ignore", invalid="ignore"):
        expm = scipy.linalg.expm(block)[:b]
    whole, rising = expm[:, b + m : b + m + e], expm[:, b + m + e :]
    return expm[:, :b], expm[:, b : b + m], whole - rising, rising
