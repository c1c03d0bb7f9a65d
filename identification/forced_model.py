"""The model of forced motion behind modes: what the measured inputs have to do with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identification.errors import IdentificationError, RecordingError
from identification.modal_parameters import modal_parameters
from identification.modes import Modes
from identification.output_error import output_error, simulated
from identification.recording import Array, Recording
from identification.regression import FROM_REST
from identification.scoring import maximize, noise_model, solve_linear
from identification.second_order import second_order
from identification.systems import SecondOrder, StateSpace


class ForcedModel(NamedTuple):
    """A model with inputs, and what it leaves of the outputs.

    Attributes:
        system: two states per mode, sampled.
        residuals: measured minus simulated outputs of each record, shape (n_outputs, n_samples).
        n_unknowns: numbers fitted: poles, shapes, participation, direct terms and initial states.
    """

    system: StateSpace
    residuals: tuple[Array, ...]
    n_unknowns: int


def forced_model(recording: Recording, modes: Modes, *, likeliest: bool = False) -> ForcedModel:
    """State space with the given poles and shapes whose simulated outputs are nearest to the recorded ones.

    Participation, direct terms and initial states enter linearly and are fitted together, every output relative to
    its RMS. Records of the kinds `FROM_REST` begin at rest.

    Args:
        recording: records with inputs, complete.
        modes: frequency, damping and shape at the outputs of the recording; a growing one is taken to decay.
        likeliest: move poles and shapes too, to the maximum of the likelihood nearby, so that nothing but noise
            is left.

    Raises:
        RecordingError: a record has no inputs.
        IdentificationError: there is no mode, or the modes have other outputs.

    Source: Ljung (1999), System Identification, 2nd ed., section 10.6: with A and C known, the outputs are linear
        in B, D and x(0).
    """
    if not len(modes):
        raise IdentificationError("there is no mode to fit the inputs to; record for longer")
    if not recording.inputs or not all(record.inputs.shape[0] for record in recording.records):
        raise RecordingError(
            "a record has no measured inputs to fit to the modes; expected forces in every record"
        )
    family = modal_parameters(modes, inputs=recording.inputs, dt=recording.dt)
    at_rest = all(record.kind in FROM_REST for record in recording.records)
    theta = family.values
    problem = output_error(recording, family, theta, initial_state="rest" if at_rest else "free")
    if problem.grows(theta) >= 1:
        theta = family.stable(theta)
    q = np.concatenate([theta, np.zeros(problem.n_unknowns - problem.n_theta)])
    linear = np.arange(q.size) >= problem.n_theta
    linear[: problem.n_theta] = family.unknown
    q = solve_linear(problem, q, linear)
    if likeliest:
        q = maximize(problem, noise_model(problem, per_record=True), q).q
    system = problem.tangent(q).system
    fitted = simulated(system, problem.runs, problem.initial(q))
    residuals = tuple(run.outputs - y for run, y in zip(problem.runs, fitted, strict=True))
    return ForcedModel(system, residuals, q.size)


def forced_matrices(recording: Recording, modes: Modes, *, dofs: Sequence[str] | None = None) -> SecondOrder:
    """Mass, damping and stiffness from modes and the inputs that drove them.

    Args:
        recording: as for `forced_model`.
        modes: one per degree of freedom.
        dofs: as for `second_order`.

    Raises:
        NotSecondOrderError: as for `second_order`.

    Source: as for `forced_model` and `second_order`.
    """
    return second_order(forced_model(recording, modes).system, dofs=dofs)
