"""How far noise moves modes realized from pulse responses or free decays, whatever the method: by drawing it anew."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError
from identification.markov_methods import MARKOV_METHODS
from identification.pulse import markov_parameters
from identification.pulse_scatter import residual_std
from identification.recording import Array, Recording
from identification.residual_scatter import DRAWS, scatter_of
from identification.spectral_scatter import ModeErrorBars, values_near
from identification.systems import MarkovParameters, Realization, StateSpace


def with_best_inputs(markov: MarkovParameters, system: StateSpace) -> StateSpace:
    """The model with the B that leaves least of all lags.

    A method that takes B from the first lags alone, as ERA/DC does, has the noise of those in it: what such a model
    leaves is more than the noise, and modes that it makes too strong scatter too little.

    Args:
        markov: the responses that were realized.
        system: model of them.

    Returns:
        The same poles and shapes.

    Raises:
        IdentificationError: the model grows so fast that its responses overflow.

    Source: Ljung (1999), System Identification, 2nd ed., section 10.6: with A and C known, the responses are linear in B.
    """
    seen = np.empty((markov.n_lags - 1, *system.C.shape))  # C Aᵏ
    rows = system.C
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(len(seen)):
            seen[k], rows = rows, rows @ system.A
    if not np.all(np.isfinite(seen)):
        raise IdentificationError(
            f"the model of order {system.n_states} grows beyond all bounds within {len(seen)} lags; expected poles inside the "
            "unit circle; try another order"
        )
    Y = markov.values[1:].reshape(-1, len(markov.inputs))
    B = np.linalg.lstsq(seen.reshape(-1, system.n_states), Y)[0]
    return replace(system, B=np.asarray(B, dtype=float))


def markov_scatter(
    recording: Recording, realization: Realization, places: Sequence[tuple[int, complex]]
) -> ModeErrorBars:
    """Standard deviations of frequencies and damping ratios, with what noise shifts on average in them.

    The noise is taken as white, with a variance of its own in each response: that of the residual of the model.

    Args:
        recording: the one that was realized.
        realization: by a method of `MARKOV_METHODS`.
        places: order and continuous-time pole [rad/s] of each mode.

    Returns:
        All three; infinite where a tenth of the tests drawn lose a mode.

    Raises:
        TooShortError: fewer samples than parameters.

    Source: parametric bootstrap, Efron and Tibshirani (1993), section 6.5.
    """
    markov = markov_parameters(recording)
    system = with_best_inputs(markov, realization.system)
    std, clean = residual_std(markov, system), system.markov(markov.n_lags).values
    method = MARKOV_METHODS[realization.method]
    known = inspect.signature(method).parameters
    settings = {name: value for name, value in realization.settings.items() if name in known}
    orders, poles = np.array([order for order, _ in places]), np.array([pole for _, pole in places])

    def estimate(values: Array) -> Array:
        found = np.full((2, poles.size), np.nan)
        try:
            again = method(
                replace(markov, values=values),
                realization.order,
                orders=sorted({*orders.tolist(), realization.order}),
                **settings,
            )
        except IdentificationError:
            return found.ravel()
        for order in np.unique(orders):
            own = orders == order
            found[:, own] = values_near(poles[own], again.at(int(order)).modes()).reshape(2, -1)
        return found.ravel()

    rng = np.random.default_rng(0)
    draws = [estimate(clean + std * rng.standard_normal(clean.shape)) for _ in range(DRAWS)]
    spread, shift = scatter_of(np.array(draws), values_near(poles, system.modes()))
    n = poles.size
    return ModeErrorBars(spread[:n], spread[n:], shift[n:])
