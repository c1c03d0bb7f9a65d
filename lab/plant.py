"""Plant: what a rig does to signals, as matrices and a few local laws; its responses take milliseconds.

A plant is the fast twin of a rig: the structure linearized about its operating point with its mass, damping and stiffness
as sums over bodies and springs, plus the force laws that are not linear, plus the measurement chain. MuJoCo stays the
reference; the tests hold one against the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy.linalg

from identification.recording import Array, Channel
from lab.forces import COULOMB
from lab.pairs import Pairs, pairs_of
from lab.paths import Path as Path
from lab.paths import pushed, recorded, structural

NO_OBSERVER = np.zeros((0, 0))
WORTH_PAIRING = 4e6
"""Products per response, of the transition with the state, beyond which finding pairs of states costs less than it saves."""

Changes = dict[int, tuple[int, float]]
"""For each input column that acts after the force of a late actuator changes within a sample: the column that acts before,
and when it changes [s]."""


@dataclass(frozen=True, eq=False)
class Law:
    """A restoring force between degrees of freedom that depends on their extension along `row`.

    Attributes:
        kind: one of the laws of `lab.forces`.
        row: extension per displacement of each degree of freedom, shape (n_dofs,).
        parameters: up to three numbers.
    """

    kind: int
    row: Array
    parameters: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Tone:
    """A force `sine` sin(2π f t) + `cosine` cos(2π f t) [N] along `row`, held over each sample from its start t."""

    row: Array
    frequency_hz: float
    sine: float
    cosine: float


@dataclass(frozen=True, eq=False)
class Plant:
    """Structure and chain as arrays.

    Attributes:
        mass, damping, stiffness: M, C_d, K, each (n_dofs, n_dofs).
        forces: force on each degree of freedom per unit of input, (n_dofs, n_inputs).
        displacement, velocity, acceleration: readings per unit of motion, each (n_outputs, n_dofs).
        inputs, outputs: channels.
        laws: local forces that are not linear.
        tones: forces that no input knows.
        input_paths, output_paths: one per channel.
        spring_stiffness, spring_damping: linear coefficients of the springs that `stiffness` and `damping` are made of.
        order: which output each recorded channel carries; empty where each carries its own.
    """

    mass: Array
    damping: Array
    stiffness: Array
    forces: Array
    displacement: Array
    velocity: Array
    acceleration: Array
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    input_paths: tuple[Path, ...]
    output_paths: tuple[Path, ...]
    spring_stiffness: Array
    spring_damping: Array
    laws: tuple[Law, ...] = ()
    tones: tuple[Tone, ...] = ()
    order: tuple[int, ...] = ()

    @property
    def n_dofs(self) -> int:
        """Degrees of freedom."""
        return self.mass.shape[0]

    def with_law(self, kind: int, row: Array, *parameters: float) -> Plant:
        """The plant with one more local force."""
        return replace(self, laws=(*self.laws, Law(kind, row, parameters)))

    def with_output(self, channel: int, **changes: object) -> Plant:
        """The plant with another path behind one output."""
        paths = list(self.output_paths)
        paths[channel] = replace(paths[channel], **changes)  # type: ignore[arg-type]
        return replace(self, output_paths=tuple(paths))

    def with_input(self, channel: int, **changes: object) -> Plant:
        """The plant with another path before one input."""
        paths = list(self.input_paths)
        paths[channel] = replace(paths[channel], **changes)  # type: ignore[arg-type]
        return replace(self, input_paths=tuple(paths))


@dataclass(frozen=True, eq=False)
class Transition:
    """Matrices of the kernel, F, G, P, Q, X, V, S, T, R, at, C, D and E, and pairs of the states they act on."""

    matrices: tuple[Array, ...]

    @cached_property
    def pairs(self) -> Pairs | None:
        """Pairs of states; None where they are not told apart."""
        return pairs_of(self.matrices[0])

    @cached_property
    def paired(self) -> tuple[Array, ...]:
        """The matrices for states in pairs; no rows stand for the transition."""
        _, G, P, Q, X, V, S, T, R, at, C, D, E = self.matrices
        assert self.pairs is not None
        shapes, inverse = self.pairs.shapes, self.pairs.inverse
        matrices = (NO_OBSERVER, inverse @ G, inverse @ P, inverse @ Q, X @ shapes, V @ shapes, S @ shapes)
        return (*matrices, T, R, at, C @ shapes, D, E)


@dataclass(frozen=True, eq=False)
class Responder:
    """A plant made ready for one sample time.

    The state holds q, q̇, then one value per lagging input and per lagging output.
    """

    plant: Plant
    dt: float
    substeps: int
    transition: Transition
    laws: np.ndarray
    parameters: Array

    @property
    def matrices(self) -> tuple[Array, ...]:
        """Matrices of the kernel."""
        return self.transition.matrices

    def outputs(
        self,
        inputs: Array,
        n_samples: int,
        *,
        initial: Array | None = None,
        observer: Array = NO_OBSERVER,
        measured: Array | None = None,
        n_record: int | None = None,
    ) -> Array:
        """Recorded outputs (n_outputs, n_samples) under recorded inputs (n_inputs, n_samples or more).

        Args:
            inputs: recorded inputs, or no rows.
            n_samples: how many samples to give.
            initial: q and q̇ at the start; rest when None.
            observer: gain (n_states, n_outputs) that pulls the state to `measured`.
            measured: recorded outputs, for the observer.
            n_record: samples of the whole record, for drift; `n_samples` when None.
        """
        # The compiler behind the kernel takes a second to load, and only responses need it.
        from lab import kernel

        plant = self.plant
        if not inputs.shape[0]:
            inputs = np.zeros((len(plant.inputs), n_samples))
        u = self._driven(inputs[:, :n_samples])
        n_states = self.matrices[0].shape[0]
        state = np.zeros(n_states)
        if initial is not None:
            state[: initial.size] = initial
        matrices, products = self.matrices, n_samples * self.matrices[1].shape[0] * n_states**2
        paired = self.transition.pairs if products > WORTH_PAIRING else None
        if paired is not None:
            matrices, state = self.transition.paired, paired.inverse @ state
            observer = paired.inverse @ observer if observer.size else observer
        y = np.zeros((0, 0))
        if measured is not None and observer.size:
            y = np.ascontiguousarray(
                structural(plant.output_paths, plant.order, measured[:, :n_samples], self.dt).T
            )
        with np.errstate(over="ignore", invalid="ignore"):
            out = kernel.respond(  # type: ignore[call-arg]
                matrices[0],
                NO_OBSERVER if paired is None else paired.turns,
                *matrices[1:],
                self.laws,
                self.parameters,
                u,
                state,
                n_record or n_samples,
                observer,
                y,
            )
        return recorded(plant.output_paths, plant.order, np.ascontiguousarray(out.T), self.dt)

    def _driven(self, inputs: Array) -> Array:
        """Inputs of the kernel, (n_samples, n_inputs): forces of the actuators, then of tones."""
        columns = pushed(self.plant.input_paths, inputs, self.dt)
        for tone in self.plant.tones:
            # A force that nobody measured is held over each sample like every other.
            phase = 2 * np.pi * tone.frequency_hz * np.arange(inputs.shape[1]) * self.dt
            columns.append(tone.sine * np.sin(phase) + tone.cosine * np.cos(phase))
        return np.array(columns).reshape(-1, inputs.shape[1]).T.copy()


def ready(plant: Plant, dt: float, *, substeps: int = 6) -> Responder:
    """The plant ready to respond at sample time `dt` [s]; `substeps` per sample where there are laws."""
    sub = substeps if plant.laws else 1
    parameters = np.zeros((len(plant.laws), 3))
    for i, law in enumerate(plant.laws):
        parameters[i, : len(law.parameters)] = law.parameters
    kinds = np.array([law.kind for law in plant.laws], dtype=np.int64)
    return Responder(plant, dt, sub, _transition(_Asked(plant, dt, sub)), kinds, parameters)


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
def _transition(asked: _Asked) -> Transition:
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
    return Transition(tuple(np.ascontiguousarray(m) for m in (F, G, P, Q, X, V, S, T, R, at, C, D, E)))


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
