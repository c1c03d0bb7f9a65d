"""Where to read the modes off models of rising order: at the lowest order that has them all.

Models of rising order that are cut from one subspace describe the structure at the first order that holds all its
modes. The states beyond it describe noise, and their poles push those of the structure near them about: the
estimates scatter more, and to first order nothing is known of that scatter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from identification.clusters import Indices, Poles, Thresholds, difference
from identification.modes import Modes
from identification.stability import Stabilization

NESTED = ("ssi_cov", "ssi_data", "next_era")
"""Methods whose models of all orders are cut from one subspace."""

REACH = 2.0
"""How many tolerances a pole may be from the mean of its cluster, whose members differ by up to one from each other."""


class Settled(NamedTuple):
    """The modes of a stabilization, each read off one model.

    Attributes:
        order: the lowest with a pole for every lasting mode.
        modes: sorted by frequency; those that the model of that order lacks come from the first that has them.
        places: order and continuous-time pole [rad/s] of each mode.
        note: the order and why, one sentence.
    """

    order: int
    modes: Modes
    places: list[tuple[int, complex]]
    note: str


def settle(stabilization: Stabilization) -> Settled:
    """The modes at the lowest order with a pole for every mode that lasts over the orders.

    A mode lasts when its cluster is at least half as long as the longest; a cluster that appears late and briefly, as when
    noise splits a mode in two, does not raise the order for all others.

    Args:
        stabilization: of models of one of the methods `NESTED`, with at least one mode.

    Returns:
        The modes with the order and the pole that each was taken from.

    Source: the order at which a diagram has stabilized, as in Peeters and De Roeck (1999), Mech. Syst. Signal
        Process. 13(6), section 4.
    """
    length = np.bincount(stabilization.cluster[stabilization.cluster >= 0])
    first = [int(np.flatnonzero(stabilization.cluster == k)[0]) for k in range(length.size)]
    lasting = 2 * length >= np.max(length)
    orders = np.unique(stabilization.orders)
    position = np.stack([_poles_of_modes(stabilization, order) for order in orders])  # (n_orders, n_modes)
    k = int(np.argmax(np.sum(position[:, lasting] >= 0, axis=1)))
    chosen = np.where(position[k] >= 0, position[k], first)
    modes = Modes(
        stabilization.frequency_hz[chosen],
        stabilization.damping_ratio[chosen],
        stabilization.shapes[:, chosen],
        stabilization.modes.outputs,
    ).normalized()
    rank = np.argsort(modes.frequency_hz, kind="stable")
    modes = modes.take(rank)
    places = [
        (int(n), complex(z)) for n, z in zip(stabilization.orders[chosen][rank], modes.poles, strict=True)
    ]
    here, order = int(np.sum(position[k] >= 0)), int(orders[k])
    note = f"Of {orders.size} orders, {order} is the lowest with a pole for every mode that lasts: {here} of {len(modes)}."
    return Settled(order, modes, places, note)


def _poles_of_modes(stabilization: Stabilization, order: int) -> Indices:
    """Position of the pole of that order that is each mode's own, -1 for none, shape (n_modes,)."""
    own = np.flatnonzero(stabilization.orders == order)
    poles = Poles(
        stabilization.orders[own],
        stabilization.frequency_hz[own],
        stabilization.damping_ratio[own],
        stabilization.shapes[:, own],
    )
    apart = difference(Poles.of(stabilization.modes), poles, Thresholds())
    nearest, mode = np.argmin(apart.distance, axis=1), np.arange(len(stabilization.modes))
    near = np.max([part[mode, nearest] for part in apart[:3]], axis=0) <= REACH
    mutual = np.argmin(apart.distance, axis=0)[nearest] == mode
    return np.where(near & mutual, own[nearest], -1)
