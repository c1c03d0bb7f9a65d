"""Responder: a plant made ready for one sample time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.recording import Array
from lab.paths import pushed, recorded, structural
from lab.plant import Plant
from lab.transition import transition_of

NO_OBSERVER = np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class Responder:
    """A plant made ready for one sample time.

    The state holds q, q̇, then one value per lagging input and per lagging output.
    """

    plant: Plant
    dt: float
    matrices: tuple[Array, ...]
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
        if not inputs.shape[0]:
            inputs = np.zeros((len(plant.inputs), n_samples))
        u = self._driven(inputs[:, :n_samples])
        state = np.zeros(self.matrices[0].shape[0])
        if initial is not None:
            state[: initial.size] = initial
        y = np.zeros((0, 0))
        if measured is not None and observer.size:
            y = np.ascontiguousarray(
                structural(plant.output_paths, plant.order, measured[:, :n_samples], self.dt).T
            )
        with np.errstate(over="ignore", invalid="ignore"):
            out = kernel.respond(  # type: ignore[call-arg]
                *self.matrices, self.laws, self.parameters, u, state, n_record or n_samples, observer, y
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
    return Responder(plant, dt, transition_of(plant, dt, sub), kinds, parameters)
