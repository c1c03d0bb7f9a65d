"""How far noise moves modes and matrices realized through an observer: the noise redrawn, and the whole way gone again.

An observer that looks far back has hundreds of coefficients that the data hardly tell one by one. However small the
noise, they move by as much as they are large, so that no linearization tells how far the poles move: on short or noisy
records it was wrong by any factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identification.errors import IdentificationError
from identification.forced_model import forced_model
from identification.modes import Modes
from identification.observer import observe
from identification.okid import okid_era, realize
from identification.progress import UNHEARD, Work
from identification.recording import Array, Recording
from identification.residual_scatter import residual_scatter
from identification.second_order import second_order
from identification.spectral_scatter import ModeErrorBars, values_near
from identification.systems import Realization, SecondOrder, StateSpace

MATRICES = ("mass", "damping", "stiffness")


class ModelErrorBars(NamedTuple):
    """Error bars of modes and matrices.

    Attributes:
        modes: of the modes.
        matrices: with their standard deviations; None where none were given.
    """

    modes: ModeErrorBars
    matrices: SecondOrder | None


def observer_scatter(
    recording: Recording,
    realization: Realization,
    modes: Modes,
    *,
    orders: Sequence[int] | None = None,
    matrices: SecondOrder | None = None,
    work: Work = UNHEARD,
) -> ModelErrorBars:
    """Standard deviations of modes, and of M, C_d and K, with what noise shifts on average in them.

    Args:
        recording: the one that was realized.
        realization: by `okid_era`.
        modes: those found.
        orders: of the model that each mode was read from; the realization's own order when None.
        matrices: those found, of `matrix_model`.
        work: told of every test drawn.

    Returns:
        Zero for data without noise; infinite where a tenth of the tests drawn lose a mode or the matrices.

    Raises:
        TooShortError: no more samples than unknowns.
        IdentificationError: there is no mode, or no model of forced motion near the modes.

    Source: as for `residual_scatter`, with the likeliest model near the modes (`forced_model`) as the truth.
    """
    n = len(modes)
    length = int(realization.settings["observer"])
    if observe(recording, observer=length).exact:
        none = ModeErrorBars(np.zeros(n), np.zeros(n), np.zeros(n))
        return ModelErrorBars(none, None if matrices is None else _with_std(matrices, 0.0))
    model = forced_model(recording, modes, likeliest=True)
    own = [realization.order] * n if orders is None else list(orders)

    def estimate(part: Recording) -> Array:
        try:
            again = _again(part, realization, sorted({*own, realization.order}), inputs=matrices is not None)
        except IdentificationError:
            return np.full(truth.size, np.nan)
        values = np.empty((2, n))
        for order in set(own):
            which = [k for k in range(n) if own[k] == order]
            values[:, which] = values_near(modes.poles[which], again.at(order).modes()).reshape(2, -1)
        return np.concatenate([values.ravel(), *_entries(again, matrices)])

    truth = np.concatenate(
        [values_near(modes.poles, model.system.modes()), *_entries(model.system, matrices)]
    )
    std, shift = residual_scatter(
        recording, model.residuals, estimate, n_unknowns=model.n_unknowns, truth=truth, work=work
    )
    found = None if matrices is None else _with_std(matrices, std[2 * n :])
    return ModelErrorBars(ModeErrorBars(std[:n], std[n : 2 * n], shift[n : 2 * n]), found)


def matrix_model(realization: Realization, n_dofs: int) -> StateSpace:
    """The model that M, C_d and K are those of: two states for each degree of freedom, where it was realized.

    Args:
        realization: models of all orders.
        n_dofs: number of degrees of freedom.

    Returns:
        That model, or that of the realization's own order.
    """
    return realization.at(2 * n_dofs) if 2 * n_dofs in realization.orders else realization.system


def _again(part: Recording, realization: Realization, orders: list[int], *, inputs: bool) -> Realization:
    """The same analysis of another recording, with B and D fitted to it where they matter."""
    settings = realization.settings
    length, n_lags, form = int(settings["observer"]), int(settings["n_lags"]), str(settings["form"])
    if inputs:
        wanted = realization.orders
        return okid_era(part, realization.order, observer=length, n_lags=n_lags, form=form, orders=wanted)
    found = observe(part, observer=length)
    return realize(found, part, realization.order, n_lags=n_lags, form=form, orders=orders)


def _entries(model: Realization | StateSpace, matrices: SecondOrder | None) -> list[Array]:
    """M, C_d and K of a model entry by entry, NaN where it has none; nothing where none are wanted."""
    if matrices is None:
        return []
    n = len(matrices.dofs)
    system = matrix_model(model, n) if isinstance(model, Realization) else model
    try:
        found = second_order(system, dofs=matrices.dofs)
    except IdentificationError:
        return [np.full(3 * n * n, np.nan)]
    return [getattr(found, name).ravel() for name in MATRICES]


def _with_std(matrices: SecondOrder, std: Array | float) -> SecondOrder:
    n = len(matrices.dofs)
    mass, damping, stiffness = np.broadcast_to(std, 3 * n * n).reshape(3, n, n)
    return replace(matrices, mass_std=mass, damping_std=damping, stiffness_std=stiffness)
