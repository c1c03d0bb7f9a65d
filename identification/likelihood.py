"""Maximum likelihood: the model under which the measured outputs are least surprising.

The inputs are known, the noise on each output is white, and how strong it is is found along the way. Then the
likeliest model has the least squared difference between measured and simulated outputs, each divided by its
own noise, and its scatter is the least that any unbiased estimate can have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.error_bars import covariance_of, delta_method, spread
from identification.errors import TooShortError
from identification.families import Model, family
from identification.modal_parameters import ModalParameters
from identification.modal_signals import Run
from identification.modes import Modes
from identification.output_error import OutputError, output_error, simulated
from identification.parameterizations import Parameterization
from identification.recording import Array, Recording, frozen
from identification.scoring import Noise, Optimum, maximize, noise_model, solve_linear
from identification.structures import LinearStructure
from identification.systems import Realization, SecondOrder, StateSpace
from identification.whiteness import whiteness

SUSPICIOUS = 1e-3
"""Probability below which residuals are not taken for white."""


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """A maximum-likelihood estimate and how far to trust it.

    Attributes:
        names: one per parameter.
        values: the parameters, shape (n_parameters,).
        covariance: of the parameters, shape (n_parameters, n_parameters), along what the data see.
        blind: combinations of parameters that the data do not see, in columns, shape (n_parameters, n_blind).
        system: the model, sampled or continuous as the parameterization has it.
        second_order: the structure with standard deviations; None where the family has no M, C, K.
        modes: the modes at the outputs with standard deviations.
        initial_states: state at the first sample of each record that began with an unknown one.
        noise_std: of each record and output, shape (n_records, n_outputs).
        whiteness: probability that white noise looks at least as correlated as the residuals of each output,
            shape (n_outputs,); below 0.01 the model or the noise is not what was assumed, and the standard
            deviations are too small.
        log_likelihood: at the estimate, with the noise at its best.
        converged: whether the estimate is at a maximum, as far as rounding allows.
        n_iterations: Gauss-Newton steps taken.
        notes: what a careful reader should know, one sentence each.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    blind: Array
    system: StateSpace
    second_order: SecondOrder | None
    modes: Modes
    initial_states: tuple[Array, ...]
    noise_std: Array
    whiteness: Array
    log_likelihood: float
    converged: bool
    n_iterations: int
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("values", "covariance", "blind", "noise_std", "whiteness"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def std(self) -> Array:
        """Standard deviation of each parameter, infinite where the data are blind for it."""
        return delta_method(self.covariance, np.eye(len(self.names)), blind=self.blind)

    def __repr__(self) -> str:
        state = "converged" if self.converged else "not converged"
        return f"Estimate({len(self.names)} parameters, {state} in {self.n_iterations} steps, {self.modes!r})"


def refine(
    recording: Recording,
    start: Model,
    *,
    parameterization: Parameterization | None = None,
    initial_state: str = "auto",
    noise_per_record: bool = True,
    max_iterations: int = 100,
) -> Estimate:
    """The maximum-likelihood estimate near a start from any other method, with standard deviations.

    Args:
        recording: records with measured inputs, or free decays; samples of the outputs may be missing (NaN).
        start: M, C, K; a state space or realization; modes; or parameters of `parameterization`.
        parameterization: what may vary. When None: every entry of symmetric M, C, K for a structure; poles,
            shapes and participation for the others. A realization and the parameterization of a structure go
            together: M, C, K are taken from it first.
        initial_state: `rest`; `free` to estimate it in each record; `auto`: free in free decays only.
        noise_per_record: whether the noise of an output may differ from record to record.
        max_iterations: steps after which to stop and say so.

    Returns:
        The estimate; look at `converged`, `whiteness` and `notes` before relying on it.

    Raises:
        RecordingError: samples of an input are missing or a record has nothing that drives the model.
        NotSecondOrderError: the channels do not fit the structure.
        IdentificationError: the start does not fit, is unstable, or has more parameters than there are samples.

    Source: Ljung (1999), System Identification, 2nd ed., sections 4.2 (output-error models) and 7.4.
    """
    if isinstance(parameterization, LinearStructure) and isinstance(start, StateSpace | Realization):
        # Modes can be refined from worse starts than the matrices that follow from them.
        start = refine(
            recording, start, initial_state=initial_state, noise_per_record=noise_per_record
        ).system
    parameterization, theta = family(start, recording, parameterization)
    problem = output_error(recording, parameterization, theta, initial_state=initial_state)
    _require_enough_samples(problem)
    theta, notes = _stable(problem, theta)
    q = np.concatenate([theta, np.zeros(problem.n_unknowns - problem.n_theta)])
    q = _with_best_linear(problem, parameterization, q)
    noise = noise_model(problem, per_record=noise_per_record)
    return _estimate(problem, maximize(problem, noise, q, max_iterations=max_iterations), noise, notes)


def _stable(problem: OutputError, theta: Array) -> tuple[Array, tuple[str, ...]]:
    """θ, or a stable one nearby if its model grows within the records, which is then said."""
    models = problem.parameterization
    if not isinstance(models, LinearStructure | ModalParameters) or problem.grows(theta) < 1:
        return theta, ()
    return models.stable(theta), ("The start was unstable; the search began from a stable model nearby.",)


def _with_best_linear(problem: OutputError, parameterization: Parameterization, q: Array) -> Array:
    """Initial states, and participation that the start does not know, by linear least squares."""
    which = np.arange(q.size) >= problem.n_theta
    if isinstance(parameterization, ModalParameters):
        which[: problem.n_theta] = parameterization.unknown
    return solve_linear(problem, q, which) if np.any(which) else q


def _estimate(problem: OutputError, optimum: Optimum, noise: Noise, notes: tuple[str, ...]) -> Estimate:
    """The optimum in the words of the user."""
    n_values = float(np.sum(problem.n_samples))
    variance = noise.variance(optimum.squares)
    # What the fit has absorbed of the noise is given back, to the noise and to the scatter.
    absorbed = 1 - problem.n_unknowns / n_values
    covariance, blind = covariance_of(optimum.information * absorbed, problem.n_theta)
    structure, modes = spread(problem, optimum.q, covariance, blind)
    system, initial = problem.tangent(optimum.q).system, problem.initial(optimum.q)
    predictions = simulated(system, problem.runs, initial)
    white = whiteness([_left(run, y) for run, y in zip(problem.runs, predictions, strict=True)])
    return Estimate(
        problem.parameterization.names,
        optimum.q[: problem.n_theta],
        covariance,
        blind,
        system,
        structure,
        modes,
        tuple(x for x in initial if x is not None),
        np.sqrt(variance / absorbed),
        white,
        -noise.cost(optimum.squares) - 0.5 * n_values * (1 + np.log(2 * np.pi)),
        optimum.converged,
        optimum.n_iterations,
        notes + _notes(problem, optimum, blind, white),
    )


def _left(run: Run, predicted: Array) -> Array:
    """What the model leaves of the outputs, NaN where samples are missing."""
    e = run.errors(predicted)
    return e if run.missing is None else np.where(run.missing, np.nan, e)


def _notes(problem: OutputError, optimum: Optimum, blind: Array, white: Array) -> tuple[str, ...]:
    notes = []
    if not optimum.converged:
        notes.append(
            f"The search stopped after {optimum.n_iterations} steps, {optimum.distance:.2g} standard deviations from "
            "the maximum as far as can be told; start closer or fit fewer parameters."
        )
    if blind.shape[1]:
        names = [name for name, row in zip(problem.parameterization.names, blind, strict=True) if np.any(row)]
        notes.append(
            f"The data do not determine {', '.join(names)} one by one; measure or drive at more places, or fix some."
        )
    coloured = [channel.name for channel, p in zip(problem.outputs, white, strict=True) if p < SUSPICIOUS]
    if coloured:
        notes.append(
            f"What is left of {', '.join(coloured)} is not white, so the model misses something or the noise is "
            "coloured, and the standard deviations are too small."
        )
    return tuple(notes)


def _require_enough_samples(problem: OutputError) -> None:
    n_values = int(np.sum(problem.n_samples))
    if n_values <= problem.n_unknowns:
        raise TooShortError(
            f"{n_values} samples cannot determine {problem.n_unknowns} unknowns; lengthen the records or fit fewer "
            "parameters"
        )
