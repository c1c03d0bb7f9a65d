"""Lifting: parameters of the model that the prior lets go, one direction after the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from identification.recording import Array
from lab.diagnosis.misfit import LOOSE, Parameters


def let_go(parameters: Parameters, *directions: Array) -> Parameters:
    """The parameters without a prior along further directions, and along all that were let go before.

    The directions need not be at right angles to one another: all that they span is free, as "this mass" and "all masses
    together" ask for.

    Args:
        parameters: of the model, none of which is a start of a record.
        directions: among the parameters, (n_parameters,) each.
    """
    basis = scipy.linalg.orth(np.column_stack([free_directions(parameters), *directions]))
    free = basis @ basis.T
    return replace(parameters, precision=np.eye(parameters.n) - free + LOOSE * free)


def free_directions(parameters: Parameters) -> Array:
    """Orthonormal directions without a prior, as columns (n_parameters, n_free)."""
    values, vectors = np.linalg.eigh(parameters.precision)
    return np.asarray(vectors[:, values < 0.5])


def is_free(parameters: Parameters, direction: Array) -> bool:
    """Whether most of a direction has no prior any more."""
    v = direction / np.linalg.norm(direction)
    return bool(np.linalg.norm(free_directions(parameters).T @ v) > np.sqrt(0.5))
