"""The model of forced motion behind modes: what the measured inputs have to do with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identification.error_bars import covariance_of
from identification.errors import IdentificationError, NotSecondOrderError, RecordingError
from identification.matrix_scatter import matrices_with_std
from identification.modal_parameters import modal_parameters
from identification.modes import Modes
from identification.output_error import OutputError, output_error, simulated
from identification.parameterizations import Tangent
from identification.recording import Array, Recording
from identification.regression import FROM_REST
from identification.scoring import Optimum, maximize, noise_model, solve_linear
from identification.second_order import second_order
from identification.systems import SecondOrder, StateSpace


class ForcedModel(NamedTuple):
    """A model with inputs, and what it leaves of the outputs.

    Attributes:
        system: two states per mode, sampled.
        residuals: measured minus simulated outputs of each record, shape (n_outputs, n_samples); zero where nothing
            was measured.
        n_unknowns: numbers fitted: poles, shapes, participation, direct terms and initial states.
        spread: how the model moves along independent directions, by one standard deviation along each; None where it
            is not at a maximum of the likelihood, or the data do not determine it.
    """

    system: StateSpace
    residuals: tuple[Array, ...]
    n_unknowns: int
    spread: Tangent | None


def forced_model(recording: Recording, modes: Modes, *, likeliest: bool = False) -> ForcedModel:
    """State space with the given poles and shapes whose simulated outputs are nearest to the recorded ones.

    Participation, direct terms and initial states enter linearly and are fitted together, every output relative to
    its RMS. Records of the kinds `FROM_REST` begin at rest.

    Args:
        recording: records with inputs, complete.
        modes: frequency, damping and shape at the outputs of the recording; a growing one is taken to decay.
        likeliest: move poles and shapes too, to the maximum of the likelihood nearby, so that nothing but noise
            is left.

    Returns:
        The model, and what it leaves.

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
    spread = None
    if likeliest:
        optimum = maximize(problem, noise_model(problem, per_record=True), q)
        q, spread = optimum.q, _spread(problem, optimum)
    system = problem.tangent(q).system
    fitted = simulated(system, problem.runs, problem.initial(q))
    residuals = tuple(run.errors(y) for run, y in zip(problem.runs, fitted, strict=True))
    return ForcedModel(system, residuals, q.size, spread)


def _spread(problem: OutputError, optimum: Optimum) -> Tangent | None:
    """How far the noise may have moved the model, direction by direction."""
    covariance, blind = covariance_of(optimum.information, problem.n_theta)
    if not optimum.converged or blind.shape[1]:
        return None
    # What the fit has absorbed of the noise is given back.
    absorbed = problem.n_unknowns / float(np.sum(problem.n_samples))
    variance, V = np.linalg.eigh(covariance / (1 - absorbed))
    moves = V * np.sqrt(np.maximum(variance, 0))  # (n_theta, n_directions)
    tangent = problem.tangent(optimum.q)
    A, B, C, D = (np.einsum("pd,p...->d...", moves, getattr(tangent, f"{name}_theta")) for name in "ABCD")
    return Tangent(tangent.system, A, B, C, D)


class ForcedMatrices(NamedTuple):
    """Matrices, and one sentence on the model that they follow from."""

    matrices: SecondOrder
    sentence: str


def forced_matrices(
    recording: Recording, modes: Modes, *, dofs: Sequence[str] | None = None, uncertainty: bool = True
) -> ForcedMatrices:
    """Mass, damping and stiffness of the likeliest model near given modes, under the inputs that drove it.

    Shapes bear more error than poles do, and matrices suffer most from it: those of the likeliest model scatter several
    times less than those of modes with inputs fitted to them, which stand only where there is no likeliest model nearby.

    Args:
        recording: as for `forced_model`.
        modes: one per degree of freedom.
        dofs: as for `second_order`.
        uncertainty: whether to find the standard deviations too, where there is a likeliest model.

    Returns:
        M, C_d and K, and whether a likeliest model stands behind them.

    Raises:
        NotSecondOrderError: as for `second_order`.

    Source: Ljung (1999), System Identification, 2nd ed., eq. (7.76); De Angelis et al. (2002), J. Appl. Mech. 69,
        eq. (18).
    """
    matrices = second_order(forced_model(recording, modes).system, dofs=dofs)
    try:
        model = forced_model(recording, modes, likeliest=True)
        if model.spread is not None:
            matrices = second_order(model.system, dofs=matrices.dofs)
            matrices = matrices_with_std(matrices, model.spread) if uncertainty else matrices
            return ForcedMatrices(matrices, _of("the likeliest model near these modes"))
    except NotSecondOrderError:
        pass
    return ForcedMatrices(matrices, _of("these modes, as there is no likeliest model near them"))


def _of(what: str) -> str:
    return f"Mass, damping and stiffness are those of {what}."
