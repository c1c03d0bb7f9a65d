"""Misfit: measured less predicted, for any change of the model's parameters and any set of causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg

from identification.recording import Array, Record, Recording
from lab.effects.effect import Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.responder import NO_OBSERVER, ready
from lab.twin import Twin

ENERGY = 0.98
"""Share of the energy of a free decay that fits may see: what follows is kept for the gain."""
FARTHEST = 8.0
"""A positive variable stays within e⁸ of its scale either way: beyond, it means nothing and only overflows."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A cause at a place, with fitted variables in units of a large step.

    Positive variables are fitted as logarithms, so that every step is possible.

    Attributes:
        kind: class of the effect.
        location: where it sits.
        guess: start and scale of its variables.
        values: where the fit stands, shape (n_variables,).
    """

    kind: type[Effect]
    location: str
    guess: Guess
    values: Array

    @classmethod
    def starting(cls, kind: type[Effect], location: str, guess: Guess) -> Hypothesis:
        """The hypothesis at its guess."""
        values = [
            np.log(guess.start[name] / scale) if name in kind.positive else guess.start[name] / scale
            for name, scale in guess.scale.items()
        ]
        return cls(kind, location, guess, np.array(values, dtype=float))

    @property
    def n(self) -> int:
        """Number of fitted variables."""
        return self.values.size

    @property
    def effect(self) -> Effect:
        """The effect at the present values."""
        values: dict[str, Any] = dict(self.guess.fixed or {})
        for (name, scale), value in zip(self.guess.scale.items(), self.values, strict=True):
            values[name] = scale * float(
                np.exp(np.clip(value, -FARTHEST, FARTHEST)) if name in self.kind.positive else value
            )
        return self.kind.of(self.location, values)

    def at(self, values: Array) -> Hypothesis:
        """The hypothesis at other values."""
        return replace(self, values=np.asarray(values, dtype=float))

    def __repr__(self) -> str:
        return f"{self.kind.cause}@{self.location}"


@dataclass(frozen=True, eq=False)
class Parameters:
    """What the model has already: a factor on every mass, stiffness and damping, each with a prior; and unknown starts.

    Attributes:
        names: of the parameters.
        widths: one standard deviation of the logarithm of each factor, then the scale of each unknown of a start.
        n_bodies, n_springs: masses come first, then stiffnesses, then dampings, then gains of inputs, then displacements and
            velocities at the start of records that do not begin at rest.
        precision: of the prior, in widths: the identity, but for starts and directions that were found to be wrong.
        started: numbers of the records that do not begin at rest.
        inputs: numbers of the inputs whose gain is not known exactly.
    """

    names: tuple[str, ...]
    widths: Array
    n_bodies: int
    n_springs: int
    precision: Array
    started: tuple[int, ...] = ()
    inputs: tuple[int, ...] = ()

    @property
    def n(self) -> int:
        """Number of parameters."""
        return self.widths.size

    @property
    def n_factors(self) -> int:
        """Number of masses, stiffnesses, dampings and gains."""
        return self.n_structural + len(self.inputs)

    @property
    def n_structural(self) -> int:
        """Number of masses, stiffnesses and dampings."""
        return self.n_bodies + 2 * self.n_springs

    def allowed(self, step: Array) -> float:
        """Share of a step (n,) that changes no factor by more than e: a line through its logarithm tells nothing of farther."""
        longest = np.max(np.abs(step[: self.n_factors] * self.widths[: self.n_factors]), initial=0.0)
        return float(1 / max(longest, 1.0))

    def factors(self, theta: Array) -> tuple[Array, Array, Array]:
        """Factors on masses, stiffnesses and dampings at `theta`, in units of the prior's width."""
        n = self.n_structural
        factors = np.exp(np.clip(theta[:n] * self.widths[:n], -3, 3))
        a, b = self.n_bodies, self.n_bodies + self.n_springs
        return factors[:a], factors[a:b], factors[b:]

    def gains(self, theta: Array) -> Array:
        """Factors on the inputs whose gain is not known exactly, (n_gains,)."""
        own = slice(self.n_structural, self.n_factors)
        return np.asarray(np.exp(np.clip(theta[own] * self.widths[own], -3, 3)))

    def start(self, theta: Array, record: int) -> Array | None:
        """Displacements and velocities at the start of a record; None where it begins at rest."""
        if record not in self.started:
            return None
        of_each = (self.n - self.n_factors) // len(self.started)
        first = self.n_factors + self.started.index(record) * of_each
        return theta[first : first + of_each] * self.widths[first : first + of_each]

    def with_start(self, record: int, scale: Array) -> Parameters:
        """The parameters with an unknown start of one more record, its unknowns of about that scale."""
        names = tuple(f"start {record} {i}" for i in range(scale.size))
        precision = np.diag(np.full(self.n + scale.size, LOOSE))
        precision[: self.n, : self.n] = self.precision
        return replace(
            self,
            names=(*self.names, *names),
            widths=np.concatenate([self.widths, scale]),
            precision=precision,
            started=(*self.started, record),
        )

    def group(self, name: str) -> list[int]:
        """Numbers of all masses, stiffnesses or dampings."""
        return [i for i, each in enumerate(self.names) if each.partition(" ")[0] == name]

    @property
    def free(self) -> Array:
        """Orthonormal directions without a prior, as columns (n, n_free)."""
        values, vectors = np.linalg.eigh(self.precision)
        return np.asarray(vectors[:, values < 0.5])

    def nominal(self, theta: Array) -> Array:
        """The parameters where only what has no prior is not as the model says."""
        return np.asarray(self.free @ (self.free.T @ theta))

    def is_free(self, direction: Array) -> bool:
        """Whether most of a direction (n,) has no prior any more."""
        v = direction / np.linalg.norm(direction)
        return bool(np.linalg.norm(self.free.T @ v) > np.sqrt(0.5))

    def lifted(self, *directions: Array) -> Parameters:
        """The parameters without a prior along further directions (n,), and along all that were lifted before.

        They need not be at right angles to one another: all that they span is free, as "this mass" and "all masses together"
        ask for.
        """
        basis = scipy.linalg.orth(np.column_stack([self.free, *directions]))
        free = basis @ basis.T
        return replace(self, precision=np.eye(self.n) - free + LOOSE * free)


LOOSE = 1e-6
"""Precision left in a direction whose prior is lifted."""


@dataclass(frozen=True, eq=False)
class Misfit:
    """Recorded data against the twin of a model.

    Attributes:
        twin: of the model.
        survey: of rig and data; None until the first fit.
        parameters: of the model.
        records: inputs (n_inputs, n), outputs (n_outputs, n) and state at the start of each record.
        dt: sample time [s].
        n_train: samples at the start of each record that fits may see.
        substeps: of the kernel.
        colour: samples that count as one, since the model errs alike for a while.
        bend: what the structure does beyond the twin, (n_outputs, n) for each record; nothing where empty.
    """

    twin: Twin
    parameters: Parameters
    records: tuple[tuple[Array, Array], ...]
    dt: float
    n_train: tuple[int, ...]
    survey: Survey | None = None
    substeps: int = 6
    colour: float = 1.0
    bend: tuple[Array, ...] = ()

    @classmethod
    def of(cls, recording: Recording, twin: Twin, parameters: Parameters, *, share: float = 0.7) -> Misfit:
        """The misfit of a recording whose channels are those of the twin."""
        records = tuple(
            (_inputs(r, len(recording.inputs)), np.asarray(r.outputs[:, :])) for r in recording.records
        )
        n_train = tuple(
            min(int(share * y.shape[1]), _decayed(y) if share < 1 and r.kind == "free_decay" else y.shape[1])
            for r, (_, y) in zip(recording.records, records, strict=True)
        )
        return cls(twin, parameters, records, recording.dt, n_train)

    @cached_property
    def measured(self) -> Array:
        """Training outputs of all records, one behind the other."""
        return np.concatenate(
            [y[:, :n] for (_, y), n in zip(self.records, self.n_train, strict=True)], axis=1
        )

    @cached_property
    def driven(self) -> Array:
        """Training inputs of all records, one behind the other."""
        return np.concatenate(
            [u[:, :n] for (u, _), n in zip(self.records, self.n_train, strict=True)], axis=1
        )

    @cached_property
    def _gaps(self) -> tuple[bool, ...]:
        """Whether samples of each record are missing."""
        return tuple(bool(np.any(np.isnan(y))) for _, y in self.records)

    def plant(self, theta: Array, causes: Sequence[Hypothesis] = ()) -> Plant:
        """The plant at parameters `theta` with causes in it."""
        plant = self.twin.changed(*self.parameters.factors(theta))
        for i, gain in zip(self.parameters.inputs, self.parameters.gains(theta), strict=True):
            plant = plant.with_input(i, gain=gain * plant.input_paths[i].gain)
        for cause in sorted(causes, key=lambda cause: cause.kind.grows):
            assert self.survey is not None
            plant = cause.effect.explain(plant, self.survey)
        return plant

    def residual(
        self,
        theta: Array,
        causes: Sequence[Hypothesis] = (),
        *,
        observer: Array = NO_OBSERVER,
        n_train: Sequence[int] | None = None,
    ) -> Array:
        """Measured less predicted training outputs, (n_outputs, n_total); zero where a sample is missing."""
        plant = self.plant(theta, causes)
        responder = ready(plant, self.dt, substeps=self.substeps)
        observer = _widened(observer, plant, self.twin.plant.n_dofs, responder.matrices[0].shape[0])
        parts = []
        for number, ((u, y), n) in enumerate(zip(self.records, n_train or self.n_train, strict=True)):
            if self.bend:
                y = y - self.bend[number]
            start = self.parameters.start(theta, number)
            if start is not None:
                start = _widened(start[:, None], plant, self.twin.plant.n_dofs, 2 * plant.n_dofs)[:, 0]
            predicted = responder.outputs(
                u, n, initial=start, observer=observer, measured=y, n_record=y.shape[1]
            )
            error = y[:, :n] - predicted
            if self._gaps[number]:
                error[np.isnan(y[:, :n])] = 0.0
            parts.append(error)
        return np.concatenate(parts, axis=1)


def _inputs(record: Record, n_inputs: int) -> Array:
    """Measured forces of a record; none act where none were measured."""
    measured = np.asarray(record.inputs[:, :])
    return measured if measured.shape[0] else np.zeros((n_inputs, record.n_samples))


def _decayed(outputs: Array) -> int:
    """Samples after which little of a decay is left, yet enough to try a prediction on."""
    power = np.nansum((outputs / np.maximum(np.nanstd(outputs, axis=1, keepdims=True), 1e-300)) ** 2, axis=0)
    return int(np.searchsorted(np.cumsum(power), ENERGY * np.sum(power))) + 1


def _widened(states: Array, plant: Plant, n: int, n_states: int) -> Array:
    """States (2 n, …) of n degrees of freedom for a plant that has more of them, or lagging channels, behind."""
    if not states.size or states.shape[0] == n_states:
        return states
    wide = np.zeros((n_states, states.shape[1]))
    # What is tied to a body moves along with it: a rigid carry-over through its stiffness.
    K, m = plant.stiffness, plant.n_dofs
    carried = -np.linalg.lstsq(K[n:, n:], K[n:, :n], rcond=None)[0] if m > n else np.zeros((0, n))
    for part in range(2):
        wide[part * m : part * m + n] = states[part * n : (part + 1) * n]
        wide[part * m + n : (part + 1) * m] = carried @ states[part * n : (part + 1) * n]
    return wide
