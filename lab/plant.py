"""Plant: what a rig does to signals, as matrices and a few local laws; its responses take milliseconds.

A plant is the fast twin of a rig: the structure linearized about its operating point with its mass, damping and stiffness
as sums over bodies and springs, plus the force laws that are not linear, plus the measurement chain. MuJoCo stays the
reference; the tests hold one against the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.signal

from identification.recording import Array, Channel

NO_OBSERVER = np.zeros((0, 0))


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


@dataclass(frozen=True)
class Path:
    """What happens to one channel between structure and recording.

    Attributes:
        gain: factor.
        delay: [s].
        lag: time constant of a first-order lag [s].
        held_lag: the same for an input whose lagging value is held over each sample, as a digital filter gives it [s].
        limit: saturation either way [unit of the channel].
        hum: sines added, each (frequency [Hz], sine, cosine).
    """

    gain: float = 1.0
    delay: float = 0.0
    lag: float = 0.0
    held_lag: float = 0.0
    limit: float = float("inf")
    hum: tuple[tuple[float, float, float], ...] = ()


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
class Responder:
    """A plant made ready for one sample time: matrices of the kernel.

    The state holds q, q̇, then one value per lagging input and per lagging output.
    """

    plant: Plant
    dt: float
    substeps: int
    matrices: tuple[Array, ...]  # F, G, P, Q, X, V, C, D, E
    laws: np.ndarray
    parameters: Array

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
        u = _driven(
            plant,
            inputs[:, :n_samples] if inputs.shape[0] else np.zeros((len(plant.inputs), n_samples)),
            self.dt,
        )
        state = np.zeros(self.matrices[0].shape[0])
        if initial is not None:
            state[: initial.size] = initial
        y = np.zeros((0, 0))
        if measured is not None and observer.size:
            y = np.ascontiguousarray(_structural(plant, measured[:, :n_samples], self.dt).T)
        with np.errstate(over="ignore", invalid="ignore"):
            out = kernel.respond(  # type: ignore[call-arg]
                *self.matrices,
                self.laws,
                self.parameters,
                u,
                state,
                self.substeps,
                n_record or n_samples,
                observer,
                y,
            )
        return _recorded(plant, np.ascontiguousarray(out.T), self.dt)


def ready(plant: Plant, dt: float, *, substeps: int = 6) -> Responder:
    """The plant ready to respond at sample time `dt` [s]; `substeps` per sample where there are laws."""
    n, n_in, n_out = plant.n_dofs, len(plant.inputs), len(plant.outputs)
    sub = substeps if plant.laws else 1
    rows = np.array([law.row for law in plant.laws]).reshape(-1, n)
    tones = np.array([tone.row for tone in plant.tones]).reshape(-1, n)
    solve = scipy.linalg.cho_factor(plant.mass)
    # Accelerations from displacement, velocity, inputs, tones and laws.
    from_q, from_v, from_u, from_t, from_g = (
        scipy.linalg.cho_solve(solve, X)
        for X in (-plant.stiffness, -plant.damping, plant.forces, tones.T, -rows.T)
    )
    lagging_in = [i for i, path in enumerate(plant.input_paths) if path.lag]
    lagging_out = [i for i, path in enumerate(plant.output_paths) if path.lag]
    a, b = 2 * n + len(lagging_in), 2 * n + len(lagging_in) + len(lagging_out)
    n_u = n_in + len(tones)
    A, B, W = np.zeros((b, b)), np.zeros((b, n_u)), np.zeros((b, len(rows)))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n], A[n : 2 * n, n : 2 * n] = from_q, from_v
    B[n : 2 * n] = np.hstack([from_u, from_t])
    W[n : 2 * n] = from_g
    for slot, i in enumerate(lagging_in, start=2 * n):
        A[n : 2 * n, slot], B[n : 2 * n, i] = from_u[:, i], 0.0
        A[slot, slot], B[slot, i] = -1 / plant.input_paths[i].lag, 1 / plant.input_paths[i].lag
    motion = np.zeros((n_out, b))
    motion[:, :n], motion[:, n : 2 * n] = plant.displacement, plant.velocity
    C = motion + plant.acceleration @ A[n : 2 * n]
    D, E = plant.acceleration @ B[n : 2 * n], plant.acceleration @ W[n : 2 * n]
    for slot, i in enumerate(lagging_out, start=a):
        rate = 1 / plant.output_paths[i].lag
        A[slot], B[slot], W[slot] = rate * C[i], rate * D[i], rate * E[i]
        A[slot, slot] -= rate
        C[i], D[i], E[i] = np.eye(b)[slot], 0.0, 0.0
    F, G, P, Q = _over_a_substep(A, B, W, dt / sub)
    C, D, E = _late_readings(plant, dt, A, B, W, C, D, E)
    X, V = np.zeros((len(rows), b)), np.zeros((len(rows), b))
    X[:, :n], V[:, n : 2 * n] = rows, rows
    parameters = np.zeros((len(rows), 3))
    for i, law in enumerate(plant.laws):
        parameters[i, : len(law.parameters)] = law.parameters
    matrices = tuple(np.ascontiguousarray(m) for m in (F, G, P, Q, X, V, C, D, E))
    kinds = np.array([law.kind for law in plant.laws], dtype=np.int64)
    return Responder(plant, dt, sub, matrices, kinds, parameters)


def _late_readings(
    plant: Plant, dt: float, A: Array, B: Array, W: Array, C: Array, D: Array, E: Array
) -> tuple[Array, Array, Array]:
    """Readings of delayed outputs part of a sample after each instant, so that whole samples make up their delay."""
    C, D, E = C.copy(), D.copy(), E.copy()
    for i, path in enumerate(plant.output_paths):
        ahead = 1 - _parts(path.delay / dt)[1]
        if ahead < 1:
            F, G, P, Q = _over_a_substep(A, B, W, ahead * dt)
            C[i], D[i], E[i] = C[i] @ F, C[i] @ G + D[i], C[i] @ (P + Q) + E[i]
    return C, D, E


def _parts(samples: float) -> tuple[int, float]:
    """Whole samples of a delay and the remaining part of one."""
    whole = int(np.floor(samples + 1e-9))
    part = samples - whole
    return whole, part if part > 1e-9 else 0.0


def _over_a_substep(A: Array, B: Array, W: Array, h: float) -> tuple[Array, Array, Array, Array]:
    """Transition over h: state, held inputs, and forces that fall from one to zero and rise from zero to one."""
    b, m, e = A.shape[0], B.shape[1], W.shape[1]
    block = np.zeros((b + m + 2 * e, b + m + 2 * e))
    block[:b, :b], block[:b, b : b + m] = A * h, B * h
    block[:b, b + m : b + m + e] = W * h
    block[b + m : b + m + e, b + m + e :] = np.eye(e)
    expm = scipy.linalg.expm(block)[:b]
    whole, rising = expm[:, b + m : b + m + e], expm[:, b + m + e :]
    return expm[:, :b], expm[:, b : b + m], whole - rising, rising


def _driven(plant: Plant, inputs: Array, dt: float) -> Array:
    """Inputs of the kernel, (n_samples, n_inputs + n_tones): what actuators make of the recorded ones, and tones."""
    n = inputs.shape[1]
    columns = []
    for row, path in zip(inputs, plant.input_paths, strict=True):
        column = _late(row, path.delay / dt) if path.delay else row
        if path.held_lag:
            share = -np.expm1(-dt / path.held_lag)
            column = scipy.signal.lfilter([share], [1, share - 1], column)
        columns.append(np.clip(path.gain * column, -path.limit, path.limit))
    for tone in plant.tones:
        # A force that nobody measured is held over each sample like every other.
        phase = 2 * np.pi * tone.frequency_hz * np.arange(n) * dt
        columns.append(tone.sine * np.sin(phase) + tone.cosine * np.cos(phase))
    return np.ascontiguousarray(np.stack(columns, axis=1)) if columns else np.zeros((n, 0))


def _recorded(plant: Plant, outputs: Array, dt: float) -> Array:
    """What the recorder gets of the structure's readings."""
    for i, path in enumerate(plant.output_paths):
        if path != Path():
            whole, part = _parts(path.delay / dt)
            signal = path.gain * _shifted(outputs[i], whole + (part > 0)) + _hum(path, outputs.shape[1], dt)
            outputs[i] = np.clip(signal, -path.limit, path.limit)
    return outputs[list(plant.order)] if plant.order else outputs


def _structural(plant: Plant, recorded: Array, dt: float) -> Array:
    """What the structure's readings were, as far as a recording tells: the chain undone, NaN where it cannot be."""
    readings = np.array(recorded)
    if plant.order:
        readings[list(plant.order)] = recorded
    for i, path in enumerate(plant.output_paths):
        if path != Path():
            whole, part = _parts(path.delay / dt)
            clipped = np.abs(readings[i]) >= path.limit
            gain = path.gain if abs(path.gain) > 1e-6 else np.nan
            readings[i] = np.where(clipped, np.nan, (readings[i] - _hum(path, recorded.shape[1], dt)) / gain)
            readings[i] = _shifted(readings[i], -(whole + (part > 0)))
    return readings


def _hum(path: Path, n: int, dt: float) -> Array:
    signal = np.zeros(n)
    for frequency, sine, cosine in path.hum:
        phase = 2 * np.pi * frequency * np.arange(n) * dt
        signal += sine * np.sin(phase) + cosine * np.cos(phase)
    return signal


def _late(held: Array, samples: float) -> Array:
    """A held force that comes later: each sample holds the mean of what arrives over it."""
    whole, part = _parts(samples)
    padded = np.concatenate([np.zeros(min(whole, held.size) + 1), held])
    return part * padded[: held.size] + (1 - part) * padded[1 : held.size + 1]


def _shifted(signal: Array, samples: int) -> Array:
    """A signal that comes whole samples later, from rest, or earlier, into the unknown."""
    n = signal.size
    if samples >= 0:
        return np.concatenate([np.zeros(min(samples, n)), signal[: max(n - samples, 0)]])
    return np.concatenate([signal[-samples:], np.full(min(-samples, n), np.nan)])


def fresh_paths(channels: Sequence[Channel]) -> tuple[Path, ...]:
    """An ideal path for every channel."""
    return tuple(Path() for _ in channels)
