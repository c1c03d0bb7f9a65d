"""How far noise moves a model realized from pulse responses or free decays."""

from __future__ import annotations

import numpy as np

from identification.errors import TooShortError
from identification.hankel_perturbation import hankel_tangent
from identification.parameterizations import Tangent
from identification.pulse import markov_parameters
from identification.recording import Array, Recording
from identification.systems import MarkovParameters, Realization, StateSpace

DRAWS = 200
"""Draws of the noise: enough for standard deviations to 5 %."""


def pulse_tangent(recording: Recording, realization: Realization, order: int) -> Tangent:
    """Derivatives of an ERA model along independent disturbances, each of one standard deviation.

    The noise is taken as white, with a variance of its own in each response: that of the residual of the
    model. Its draws come from a fixed seed, so that the same recording has the same error bars.

    Args:
        recording: the one that was realized.
        realization: by `era`.
        order: number of states of the model asked for.

    Returns:
        The covariance of the model's parameters is Σ dθ dθᵀ over the directions.

    Raises:
        TooShortError: fewer samples than parameters.

    Source: parametric bootstrap, Efron and Tibshirani (1993), section 6.5, of the model linearized as in
        `hankel_tangent`.
    """
    markov, system = markov_parameters(recording), realization.at(order)
    std = residual_std(markov, system)
    rng = np.random.default_rng(0)
    changes = std * rng.standard_normal((DRAWS, *markov.values.shape)) / np.sqrt(DRAWS)
    rows, columns = int(realization.settings["n_rows"]), int(realization.settings["n_columns"])
    return hankel_tangent(system, changes, n_rows=rows, n_columns=columns)


def residual_std(markov: MarkovParameters, system: StateSpace) -> Array:
    """Standard deviation of what the model leaves of each response, shape (n_outputs, n_inputs).

    Args:
        markov: the responses measured.
        system: the model.

    Returns:
        In the units of the responses.

    Raises:
        TooShortError: fewer samples than parameters.

    Source: Seber and Lee (2003), Linear Regression Analysis, 2nd ed., theorem 3.3, the unbiased estimate of a variance.
    """
    residual = markov.values[1:] - system.markov(markov.n_lags).values[1:]
    n_lags, n_outputs, n_inputs = residual.shape
    n_free = n_lags - system.n_states * (n_outputs + n_inputs) / (n_outputs * n_inputs)
    if n_free < 1:
        raise TooShortError(
            f"{n_lags} lags leave nothing to tell the noise by from {system.n_states} states; record for longer"
        )
    return np.asarray(np.sqrt(np.sum(residual**2, axis=0) / n_free))
