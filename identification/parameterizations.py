"""How a model depends on its parameters: the model at θ and its derivative with respect to each of them.

Whatever offers `names`, `start` and `tangent` can be fitted by `refine` and judged by `cramer_rao_bound`: the
matrices of a structure (structures.py, spring_network.py), modes (modal_parameters.py), or any function of
parameters that gives a state space (`Custom`, below).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from identification.errors import IdentificationError
from identification.recording import Array, Channel, frozen
from identification.systems import StateSpace


@dataclass(frozen=True, eq=False)
class Tangent:
    """A state-space model and how its matrices move with each parameter.

    Attributes:
        system: the model, sampled or continuous.
        A_theta: ∂A/∂θ, shape (n_parameters, n_states, n_states).
        B_theta: ∂B/∂θ, shape (n_parameters, n_states, n_inputs).
        C_theta: ∂C/∂θ, shape (n_parameters, n_outputs, n_states).
        D_theta: ∂D/∂θ, shape (n_parameters, n_outputs, n_inputs).
    """

    system: StateSpace
    A_theta: Array
    B_theta: Array
    C_theta: Array
    D_theta: Array

    def __post_init__(self) -> None:
        n_parameters = len(self.A_theta)
        for name in "ABCD":
            derivative = frozen(getattr(self, f"{name}_theta"))
            expected = (n_parameters, *getattr(self.system, name).shape)
            if derivative.shape != expected:
                raise IdentificationError(f"{name}_theta has shape {derivative.shape}; expected {expected}")
            object.__setattr__(self, f"{name}_theta", derivative)

    @property
    def n_parameters(self) -> int:
        """Number of parameters."""
        return len(self.A_theta)


class Parameterization(Protocol):
    """A family of models, one for each value of the parameters θ."""

    @property
    def names(self) -> tuple[str, ...]:
        """One name per parameter."""

    def start(self, model: Any) -> Array:
        """The θ whose model comes close to the given one, shape (n_parameters,)."""

    def tangent(self, theta: Array, inputs: Sequence[Channel], outputs: Sequence[Channel]) -> Tangent:
        """The model at θ between these channels, with its derivatives."""


@dataclass(frozen=True, eq=False)
class Custom:
    """Any state space that is a smooth function of parameters.

    Attributes:
        names: one per parameter.
        system: θ, shape (n_parameters,), to the model. Its channels must be those of the recording.
        derivatives: θ to the model's `Tangent`; central differences of `system` when None.
    """

    names: tuple[str, ...]
    system: Callable[[Array], StateSpace]
    derivatives: Callable[[Array], Tangent] | None = None

    def start(self, model: Any) -> Array:
        """The model as it is: parameters of its own have no other start."""
        return start_values(model, self.names)

    def tangent(self, theta: Array, inputs: Sequence[Channel], outputs: Sequence[Channel]) -> Tangent:
        """The model at θ, with its derivatives.

        Raises:
            IdentificationError: the function's model has other channels.
        """
        tangent = self.derivatives(theta) if self.derivatives else central_differences(self.system, theta)
        require_channels(tangent.system, inputs, outputs)
        return tangent


def start_values(model: Any, names: Sequence[str]) -> Array:
    """Start values as an array of the right length.

    Args:
        model: numbers, one for each name.
        names: of the parameters.

    Returns:
        Shape (n_parameters,).

    Raises:
        IdentificationError: `model` is not one finite number for each name.
    """
    theta = np.asarray(model, dtype=float) if isinstance(model, np.ndarray | list | tuple) else None
    if theta is None or theta.shape != (len(names),) or not np.all(np.isfinite(theta)):
        given = type(model).__name__ if theta is None else f"values {theta}"
        raise IdentificationError(
            f"the start is {given}; expected an array of {len(names)} finite values for {', '.join(names)}"
        )
    return theta


def central_differences(system: Callable[[Array], StateSpace], theta: Array) -> Tangent:
    """The model at θ with derivatives good to about ten digits of the parameter's own scale.

    Args:
        system: θ to the model.
        theta: parameters; a zero is moved by steps as for one.

    Returns:
        Model and derivatives.

    Source: Nocedal and Wright (2006), Numerical Optimization, 2nd ed., section 8.1.
    """
    steps = np.cbrt(np.finfo(float).eps) * np.where(theta == 0, 1.0, np.abs(theta))
    pairs = []
    for i, step in enumerate(steps):
        move = np.zeros_like(theta)
        move[i] = step
        pairs.append((system(theta + move), system(theta - move)))
    dA, dB, dC, dD = (
        np.stack(
            [
                (getattr(up, name) - getattr(down, name)) / (2 * step)
                for (up, down), step in zip(pairs, steps, strict=True)
            ]
        )
        for name in "ABCD"
    )
    return Tangent(system(theta), dA, dB, dC, dD)


def require_channels(system: StateSpace, inputs: Sequence[Channel], outputs: Sequence[Channel]) -> None:
    """Check that a model has the channels of the recording, in the same order.

    Args:
        system: the model.
        inputs: input channels of the recording.
        outputs: output channels of the recording.

    Raises:
        IdentificationError: it has others.
    """
    for side, own, wanted in (("inputs", system.inputs, inputs), ("outputs", system.outputs, outputs)):
        mine, theirs = ([channel.name for channel in channels] for channels in (own, wanted))
        if mine != theirs:
            raise IdentificationError(
                f"the model has {side} {', '.join(mine) or 'none'} and the recording {', '.join(theirs) or 'none'}; "
                "select the same channels in the same order"
            )
