"""Error bars: how far modes and matrices may be from the truth, one standard deviation, for every method.

- `era`: the residual's noise, to first order through the Hankel matrix (`pulse_scatter`).
- `okid_era`: the noise redrawn, and the whole way gone again (`observer_scatter`).
- `ssi_cov`, `ssi_data`, `next_era`: the record's own randomness, as the mean of a series in time (`covariance_scatter`).
- `plscf` and `efdd`: the noise redrawn, or pieces left out (`spectral_scatter`).
- `era_dc`, `itd`, `mrtd`, `mmrtd`: the noise redrawn, and the way to the modes gone again (`markov_scatter`).

Over repeated tests the truth lies within ±2 of them about 95 % of the time, as long as the method itself has no
bias to speak of; where noise is redrawn, what it shifts on average counts as part of them. Without noise they are
zero or of the size of rounding. The scatter of a mode over model orders is something else and tells nothing about
its error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from identification.covariance_scatter import covariance_scatter
from identification.error_bars import modes_with_std
from identification.errors import IdentificationError
from identification.markov_scatter import markov_scatter
from identification.matrix_scatter import matrices_with_std
from identification.modes import Modes
from identification.observer_scatter import matrix_model, observer_scatter
from identification.parameterizations import Tangent
from identification.pulse_scatter import pulse_tangent
from identification.recording import Array, Recording
from identification.settled import NESTED
from identification.spectral_scatter import SPECTRAL, Tracks, spectral_scatter
from identification.systems import Realization, SecondOrder


class Placed(NamedTuple):
    """Where a mode stands among the models: at an order, with a continuous-time pole [rad/s]."""

    order: int
    pole: complex


def modes_with_error_bars(
    recording: Recording,
    realization: Realization,
    modes: Modes,
    *,
    places: Sequence[Placed] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Modes:
    """The modes with the standard deviations of their frequencies and damping ratios.

    Args:
        recording: the one that was realized.
        realization: by any method of `METHODS`.
        modes: those found.
        places: where each of them stands; at the realization's own order when None.
        settings: further settings that the method was given.

    Returns:
        The same modes; a standard deviation is infinite where a part of the data left out loses the mode.

    Raises:
        TooShortError: too few data to tell.
        IdentificationError: the records or the model allow no error bars; says why.

    Source: as for `pulse_tangent`, `observer_scatter`, `covariance_scatter`, `spectral_scatter` and
        `markov_scatter`.
    """
    if places is None:
        places = [Placed(realization.order, complex(pole)) for pole in modes.poles]
    if not places:
        return modes
    given = dict(settings or {})
    if realization.method in NESTED:
        std = covariance_scatter(recording, realization, places, references=given.get("references"))
    elif realization.method == "era":
        std = _from_tangents(recording, realization, places)
    elif realization.method == "okid_era":
        std = observer_scatter(recording, realization, modes, orders=[place.order for place in places]).modes[
            :2
        ]
    elif realization.method in SPECTRAL:
        std = spectral_scatter(recording, realization, Tracks.of_places(places), settings=given)[:2]
    else:
        std = markov_scatter(recording, realization, places)[:2]
    return replace(modes, frequency_std=std[0], damping_std=std[1])


def matrices_with_error_bars(
    recording: Recording, realization: Realization, matrices: SecondOrder
) -> SecondOrder:
    """M, C_d and K with the standard deviation of each entry.

    Args:
        recording: the one that was realized.
        realization: by `era`; for `okid_era` there is `observer_scatter`.
        matrices: those of `matrix_model`.

    Returns:
        The same matrices with their standard deviations.

    Raises:
        TooShortError: too few data to tell.
        IdentificationError: the method or the model allows no error bars; says why.

    Source: as for `pulse_tangent`; the derivatives are central differences.
    """
    order = matrix_model(realization, len(matrices.dofs)).n_states
    return matrices_with_std(matrices, _tangent(recording, realization, order))


def _tangent(recording: Recording, realization: Realization, order: int) -> Tangent:
    if realization.method == "era":
        return pulse_tangent(recording, realization, order)
    raise IdentificationError(
        f"models of {realization.method!r} have no error bars of M, C and K; take era, okid_era or a refinement"
    )


def _from_tangents(
    recording: Recording, realization: Realization, places: Sequence[Placed]
) -> tuple[Array, Array]:
    std = np.empty((2, len(places)))
    for order in {place.order for place in places}:
        tangent = _tangent(recording, realization, order)
        found = modes_with_std(tangent, np.eye(len(tangent.A_theta)))
        if found.frequency_std is None or found.damping_std is None:
            raise IdentificationError(f"the model of order {order} has no modes; take another order")
        for k in (k for k, place in enumerate(places) if place.order == order):
            nearest = int(np.argmin(np.abs(found.poles - places[k].pole)))
            std[:, k] = found.frequency_std[nearest], found.damping_std[nearest]
    return std[0], std[1]
