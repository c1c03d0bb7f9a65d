"""The difference between measured and simulated outputs, as a function of the parameters.

The unknowns q are θ and, for each record that does not begin at rest, the state at its first sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification import cascade, modal_responses
from identification.errors import IdentificationError, RecordingError
from identification.modal_signals import Run, spectrum
from identification.parameterizations import Parameterization, Tangent
from identification.recording import Array, Channel, Recording
from identification.systems import StateSpace

MAX_GROWTH = 200.0
"""Largest exponent by which a response may grow over a record: its square must stay a finite number."""


@dataclass(frozen=True, eq=False)
class OutputError:
    """Records and the family of models that shall explain them.

    Attributes:
        parameterization: the family.
        inputs, outputs: channels.
        runs: the records.
        released: whether each one begins from an unknown state.
        n_states: states of the model.
    """

    parameterization: Parameterization
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    runs: tuple[Run, ...]
    released: tuple[bool, ...]
    n_states: int

    @property
    def n_theta(self) -> int:
        """Number of parameters, initial states aside."""
        return len(self.parameterization.names)

    @property
    def n_unknowns(self) -> int:
        """Number of parameters and initial states."""
        return self.n_theta + self.n_states * sum(self.released)

    @property
    def n_samples(self) -> Array:
        """Samples measured in each record and output, shape (n_records, n_outputs)."""
        missing = (0 if run.missing is None else np.sum(run.missing, axis=1) for run in self.runs)
        whole = ((len(self.outputs), run.outputs.shape[1]) for run in self.runs)
        return np.stack(
            [np.full(n, float(size)) - gone for (n, size), gone in zip(whole, missing, strict=True)]
        )

    @property
    def power(self) -> Array:
        """Mean square of each record and output, shape (n_records, n_outputs); the largest one for a silent output."""
        squares = np.stack([np.sum(run.outputs**2, axis=1) for run in self.runs])
        power = squares / np.maximum(self.n_samples, 1)
        return np.where(power > 0, power, np.max(power))

    def initial(self, q: Array) -> list[Array | None]:
        """The initial state of each record, None for rest."""
        states = iter(q[self.n_theta :].reshape(sum(self.released), self.n_states))
        return [next(states) if released else None for released in self.released]

    def tangent(self, q: Array) -> Tangent:
        """The model at q with its derivatives.

        Raises:
            numpy.linalg.LinAlgError: there is no such model.
        """
        return self.parameterization.tangent(q[: self.n_theta], self.inputs, self.outputs)

    def grows(self, q: Array) -> float:
        """Largest exponent by which a response grows over the longest record, negative where all decay."""
        system = self.tangent(q).system
        poles = np.linalg.eigvals(system.A)
        size = np.maximum(np.abs(poles), np.finfo(float).tiny)
        rate = np.log(size) if system.dt else poles.real * self.runs[0].dt
        return float(np.max(rate, initial=-np.inf) * max(run.outputs.shape[1] for run in self.runs))

    def squares(self, q: Array) -> Array:
        """Sum of squared errors of each record and output, (n_records, n_outputs); infinite without a model."""
        try:
            possible = self.grows(q) < MAX_GROWTH
        except np.linalg.LinAlgError:
            possible = False
        if not possible:
            return np.full((len(self.runs), len(self.outputs)), np.inf)
        predictions = simulated(self.tangent(q).system, self.runs, self.initial(q))
        return np.stack(
            [np.sum(run.errors(y) ** 2, axis=1) for run, y in zip(self.runs, predictions, strict=True)]
        )

    def normal_equations(self, q: Array, weights: Array) -> tuple[Array, Array]:
        """Jᵀ W e, shape (n_unknowns,), and the Fisher information Jᵀ W J.

        Args:
            q: unknowns, shape (n_unknowns,).
            weights: one over the noise variance of each record and output, shape (n_records, n_outputs).
        """
        tangent = self.tangent(q)
        modes = spectrum(tangent.system)
        gradient, information = np.zeros(self.n_unknowns), np.zeros((self.n_unknowns, self.n_unknowns))
        first = self.n_theta
        for run, initial, w in zip(self.runs, self.initial(q), weights, strict=True):
            if modes is None:
                g, H = cascade.normal_equations(tangent, run, initial, w)
            else:
                g, H = modal_responses.normal_equations(tangent, modes, run, initial, w)
            rows = np.arange(len(g))
            rows[self.n_theta :] += first - self.n_theta
            gradient[rows] += g
            information[np.ix_(rows, rows)] += H
            first += len(g) - self.n_theta
        return gradient, information


def output_error(
    recording: Recording,
    parameterization: Parameterization,
    theta: Array,
    *,
    initial_state: str = "auto",
) -> OutputError:
    """The fitting problem of a recording.

    Args:
        recording: records with inputs, or free decays. Samples of the outputs may be missing (NaN) and count for nothing.
        parameterization: the family of models.
        theta: any parameters in it, to see how many states it has.
        initial_state: `rest`, `free`, or `auto` for free in free decays only.

    Returns:
        Records and family, ready to be compared.

    Raises:
        IdentificationError: there is no model at θ.
        RecordingError: samples of an input are missing, a record has neither inputs nor a free initial state, the model is
            sampled at another rate, or `initial_state` is unknown.
    """
    if initial_state not in ("auto", "rest", "free"):
        raise RecordingError(f"initial_state is {initial_state!r}; expected auto, rest or free")
    recording.require_complete(but_outputs=True)
    released = tuple(
        initial_state == "free" or (initial_state == "auto" and record.kind == "free_decay")
        for record in recording.records
    )
    runs = []
    for number, (record, free) in enumerate(zip(recording.records, released, strict=True)):
        inputs = np.asarray(record.inputs[:, :], dtype=float) if record.inputs.shape[0] else None
        if inputs is None and not free:
            raise RecordingError(
                f"record {number} of kind {record.kind} has no measured inputs, so a simulation stays at rest; "
                "expected inputs, or a free decay; use an output-only method"
            )
        active = np.flatnonzero(np.any(inputs, axis=1)) if inputs is not None else np.zeros(0, dtype=np.intp)
        forces = inputs[active] if inputs is not None else np.zeros((0, record.n_samples))
        outputs = np.asarray(record.outputs[:, :], dtype=float)
        missing = np.isnan(outputs)
        if missing.any():
            runs.append(Run(forces, active, np.where(missing, 0, outputs), recording.dt, missing))
        else:
            runs.append(Run(forces, active, outputs, recording.dt))
    try:
        system = parameterization.tangent(theta, recording.inputs, recording.outputs).system
    except np.linalg.LinAlgError as error:
        raise IdentificationError(
            f"the start has no state space ({error}), as when its mass matrix is singular; give every degree of freedom "
            "a mass"
        ) from error
    if system.dt and abs(system.dt / recording.dt - 1) > 1e-9:
        raise RecordingError(
            f"the recording has {recording.sample_rate:g} Hz and the start is sampled at {1 / system.dt:g} Hz; "
            "give a start of the same rate, or a continuous one"
        )
    return OutputError(
        parameterization, recording.inputs, recording.outputs, tuple(runs), released, system.n_states
    )


def simulated(system: StateSpace, runs: Sequence[Run], initial: Sequence[Array | None]) -> list[Array]:
    """Outputs of each run, shape (n_outputs, n_samples).

    Args:
        system: the model.
        runs: the records.
        initial: state at the first sample of each; rest when None.

    Returns:
        One array per record.
    """
    modes = spectrum(system)
    if modes is None:
        return [cascade.simulate(system, run, x0) for run, x0 in zip(runs, initial, strict=True)]
    return [modal_responses.simulate(system, modes, run, x0) for run, x0 in zip(runs, initial, strict=True)]
