"""The family of models that a start belongs to, when none is named, and where in it the start lies."""

from __future__ import annotations

import numpy as np

from identification.errors import IdentificationError
from identification.modal_parameters import modal_parameters
from identification.modes import Modes
from identification.parameterizations import Parameterization
from identification.recording import Array, Recording
from identification.structures import free_matrices
from identification.systems import Realization, SecondOrder, StateSpace

Model = SecondOrder | StateSpace | Realization | Modes | Array
"""A structure, a state space, modes, or parameters that go with a parameterization."""


def family(
    model: Model, recording: Recording, parameterization: Parameterization | None
) -> tuple[Parameterization, Array]:
    """A parameterization and the parameters of the model in it.

    Args:
        model: structure, state space, modes or parameters.
        recording: its channels and sample rate.
        parameterization: all entries of M, C, K for a structure, modal parameters for others, when None.

    Returns:
        The family, and θ, shape (n_parameters,).

    Raises:
        IdentificationError: the model is none of those, or does not fit the parameterization.
    """
    if parameterization is None:
        if isinstance(model, SecondOrder):
            parameterization = free_matrices(model.dofs)
        elif isinstance(model, StateSpace | Realization | Modes):
            parameterization = modal_parameters(model, inputs=recording.inputs, dt=recording.dt)
        else:
            raise IdentificationError(
                f"the model is {type(model).__name__}; expected SecondOrder, StateSpace, Realization or Modes, or "
                "parameters together with a parameterization"
            )
    return parameterization, np.asarray(parameterization.start(model), dtype=float)
