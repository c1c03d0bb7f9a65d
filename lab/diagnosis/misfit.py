"""Misfit: measured less predicted, for any change of the model's parameters and any set of causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.recording import Array, Record, Recording
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.parameters import Parameters
from lab.effects.survey import Survey
from lab.plant import Plant
from lab.responder import NO_OBSERVER, ready
from lab.twin import Twin

SHARE = 0.7
"""Of every record, from its start, that fits may see: what follows is kept for the gain."""
ENERGY = 0.98
"""Share of the energy of a free decay that fits may see, if that comes sooner."""


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
    def of(cls, recording: Recording, twin: Twin, parameters: Parameters, *, share: float = SHARE) -> Misfit:
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

    def counting_as_one(self, n_train: Sequence[int] | None = None) -> float | Array:
        """Samples of a residual that count as one: `colour`, and for each output more where some are missing, (n_outputs,)."""
        if not any(self._gaps):
            return self.colour
        known = [~np.isnan(y[:, :n]) for (_, y), n in zip(self.records, n_train or self.n_train, strict=True)]
        every = np.concatenate(known, axis=1)
        return np.asarray(self.colour * every.shape[1] / np.maximum(np.sum(every, axis=1), 1))

    def made_whole(self, residual: Array) -> Array:
        """A residual (n_outputs, n_total) with the power that it would have if no sample was missing."""
        return np.asarray(residual * np.sqrt(np.reshape(self.counting_as_one() / self.colour, (-1, 1))))

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
