"""What an experiment can tell: Fisher information, the Cramér-Rao bound, and what follows for M, C, K and modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from identification.error_bars import covariance_of, delta_method, spread
from identification.errors import IdentificationError
from identification.families import Model, family
from identification.modal_parameters import ModalParameters
from identification.modes import Modes
from identification.output_error import OutputError, output_error, simulated
from identification.parameterizations import Parameterization
from identification.recording import Array, Channel, Record, Recording, frozen
from identification.scoring import Curvature
from identification.systems import SecondOrder


@dataclass(frozen=True, eq=False, repr=False)
class Bound:
    """The least scatter that an unbiased estimate from an experiment can have.

    Attributes:
        names: one per parameter.
        values: the parameters, shape (n_parameters,).
        covariance: of the parameters, shape (n_parameters, n_parameters), along what the experiment sees.
        blind: combinations of parameters that it does not see, in columns, shape (n_parameters, n_blind).
        second_order: the structure with standard deviations; None where the model has no M, C, K.
        modes: the modes at the outputs with standard deviations.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    blind: Array
    second_order: SecondOrder | None
    modes: Modes

    def __post_init__(self) -> None:
        for name in ("values", "covariance", "blind"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def std(self) -> Array:
        """Standard deviation of each parameter, infinite where the experiment is blind for it."""
        return delta_method(self.covariance, np.eye(len(self.names)), blind=self.blind)

    def __repr__(self) -> str:
        return f"Bound({len(self.names)} parameters, {self.blind.shape[1]} combinations not identifiable)"


def fisher_information(
    model: Model,
    recording: Recording,
    *,
    noise_std: ArrayLike,
    parameterization: Parameterization | None = None,
    initial_state: str = "auto",
    initial_states: Sequence[Array] | None = None,
) -> Array:
    """What the experiment tells about the parameters, unknown initial states being eliminated.

    Args:
        model: the truth, as far as it is known: M, C, K, a state space, or parameters.
        recording: inputs, channels and sample rate, done or only planned: the outputs do not matter.
        noise_std: of the outputs, a number or shape (n_outputs,) or (n_records, n_outputs).
        parameterization: all entries of M, C, K when None, or poles, shapes and participation of a state space.
        initial_state: `rest`, `free`, or `auto` for free in free decays only.
        initial_states: true states at the first samples of the records that begin with unknown ones.

    Returns:
        Shape (n_parameters, n_parameters), in one over the product of the units of the two parameters.

    Raises:
        IdentificationError: the model, the noise or the initial states do not fit the recording.

    Source: Kay (1993), Fundamentals of Statistical Signal Processing I, eq. (3.31), for noise that is Gaussian,
    white and of known size; not knowing the size takes nothing away.
    """
    problem, q, weights = _experiment(
        model, recording, noise_std, parameterization, initial_state, initial_states
    )
    _, information = problem.normal_equations(q, weights)
    n = problem.n_theta
    own, cross, rest = information[:n, :n], information[:n, n:], information[n:, n:]
    lost = (
        np.stack([Curvature.of(rest).solve(column) for column in cross], axis=1) if rest.size else 0 * cross.T
    )
    return np.asarray(own - cross @ lost)


def cramer_rao_bound(
    model: Model,
    recording: Recording,
    *,
    noise_std: ArrayLike,
    parameterization: Parameterization | None = None,
    initial_state: str = "auto",
    initial_states: Sequence[Array] | None = None,
) -> Bound:
    """The least standard deviations of parameters, M, C, K and modes that the experiment allows.

    Args:
        model, recording, noise_std, parameterization, initial_state, initial_states: as for
            `fisher_information`.

    Returns:
        The bound; infinite for what the experiment does not identify.

    Raises:
        IdentificationError: as for `fisher_information`.

    Source: Kay (1993), eq. (3.20) and, for functions of the parameters, (3.30).
    """
    problem, q, weights = _experiment(
        model, recording, noise_std, parameterization, initial_state, initial_states
    )
    _, information = problem.normal_equations(q, weights)
    covariance, blind = covariance_of(information, problem.n_theta)
    structure, modes = spread(problem, q, covariance, blind)
    return Bound(problem.parameterization.names, q[: problem.n_theta], covariance, blind, structure, modes)


def predict(
    model: Model,
    recording: Recording,
    *,
    parameterization: Parameterization | None = None,
    initial_states: Sequence[Array] | None = None,
) -> Recording:
    """The recording with the outputs that the model gives under its inputs, without noise.

    Args:
        model, parameterization: as for `fisher_information`.
        recording: inputs, channels and sample rate.
        initial_states: states at the first samples, one per record; rest when None.

    Returns:
        The same channels, inputs and lengths.
    """
    state = "rest" if initial_states is None else "free"
    problem, q, _ = _experiment(model, recording, 1.0, parameterization, state, initial_states)
    outputs = simulated(problem.tangent(q).system, problem.runs, problem.initial(q))
    records = [replace(record, outputs=y) for record, y in zip(recording.records, outputs, strict=True)]
    return replace(recording, records=tuple(records))


def planned(
    signals: Sequence[Array],
    inputs: Sequence[Channel],
    outputs: Sequence[Channel],
    *,
    sample_rate: float,
    kind: str = "other",
) -> Recording:
    """A test that has not been done yet, as a recording without responses.

    Args:
        signals: inputs of each record, shape (n_inputs, n_samples).
        inputs: input channels.
        outputs: output channels.
        sample_rate: [Hz].
        kind: of all records, such as `pulse` or `random`.

    Returns:
        Inputs as planned, outputs zero: for `fisher_information`, `cramer_rao_bound` and `predict`.
    """
    records = tuple(Record(kind, u, np.zeros((len(outputs), np.shape(u)[1]))) for u in signals)
    return Recording(records, tuple(inputs), tuple(outputs), sample_rate)


def _experiment(
    model: Model,
    recording: Recording,
    noise_std: ArrayLike,
    parameterization: Parameterization | None,
    initial_state: str,
    initial_states: Sequence[Array] | None,
) -> tuple[OutputError, Array, Array]:
    """The fitting problem, the unknowns and the weights of each record and output."""
    parameterization, theta = family(model, recording, parameterization)
    if isinstance(parameterization, ModalParameters) and np.any(parameterization.unknown):
        raise IdentificationError(
            f"the {type(model).__name__} does not say how all inputs take part; give a state space or a structure with "
            f"the inputs {', '.join(channel.name for channel in recording.inputs)}"
        )
    problem = output_error(recording, parameterization, theta, initial_state=initial_state)
    shape = (len(problem.runs), len(problem.outputs))
    std = np.asarray(noise_std, dtype=float)
    if std.shape not in ((), shape[1:], shape) or not np.all((std > 0) & np.isfinite(std)):
        raise IdentificationError(
            f"noise_std is {std.tolist()}; expected positive numbers, one, {shape[1]} or {shape[0]} x {shape[1]}"
        )
    states = [] if initial_states is None else [np.asarray(x, dtype=float) for x in initial_states]
    wanted = [(problem.n_states,)] * sum(problem.released)
    if [x.shape for x in states] != wanted:
        raise IdentificationError(
            f"initial_states are {len(states)} of shapes {[x.shape for x in states]}; expected {len(wanted)} of "
            f"{problem.n_states} states, one for each record that begins with an unknown one"
        )
    return problem, np.concatenate([theta, *states]), np.broadcast_to(std**-2.0, shape)
