"""Where to read the modes off models of rising order: at the lowest order that has them all.

Models of rising order that are cut from one subspace describe the structure at the first order that holds all its
modes. The states beyond it describe noise, and their poles push those of the structure near them about: the
estimates scatter more, and to first order nothing is known of that scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.clusters import Indices, Poles, Thresholds, difference
from identification.modes import Modes
from identification.stability import Stabilization

NESTED = ("ssi_cov", "ssi_data", "next_era")
"""Methods whose models of all orders are cut from one subspace."""

REACH = 2.0
"""How many tolerances a pole may be from the mean of its cluster, whose members differ by up to one from each other."""


LASTING = 1 / 3
"""Length of a cluster over that of the longest one, from which on it counts as a mode that lasts."""


class Settled(NamedTuple):
    """The modes of a stabilization, each read off one model.

    Attributes:
        order: the lowest with a pole for every lasting mode.
        modes: sorted by frequency; those that the model of that order lacks come from the first that has them.
        places: order and continuous-time pole [rad/s] of each mode.
        brief: whether each mode shows at less than a third as many orders as the one that lasts longest.
        notes: the order and why, and which brief poles were taken for part of another mode, one sentence each.
    """

    order: int
    modes: Modes
    places: list[tuple[int, complex]]
    brief: tuple[bool, ...]
    notes: tuple[str, ...]


def settle(stabilization: Stabilization) -> Settled:
    """The modes at the lowest order with a pole for every mode that lasts over the orders.

    A mode lasts when its cluster is at least a third as long as the longest. A cluster that appears late and briefly does not
    raise the order for all others, and is left out where it resembles a mode that lasts, as when noise splits one in two.

    Args:
        stabilization: of models of one of the methods `NESTED`, with at least one mode.

    Returns:
        The modes with the order and the pole that each was taken from.

    Source: the order at which a diagram has stabilized, as in Peeters and De Roeck (1999), Mech. Syst. Signal
        Process. 13(6), section 4.
    """
    length = np.bincount(stabilization.cluster[stabilization.cluster >= 0])
    first = [int(np.flatnonzero(stabilization.cluster == k)[0]) for k in range(length.size)]
    lasting = length >= LASTING * np.max(length)
    orders = np.unique(stabilization.orders)
    position = np.stack([_poles_of_modes(stabilization, order) for order in orders])  # (n_orders, n_modes)
    k = int(np.argmax(np.sum(position[:, lasting] >= 0, axis=1)))
    split = np.flatnonzero(~lasting & (position[k] < 0) & _like_one_of(stabilization.modes, lasting))
    chosen = np.where(position[k] >= 0, position[k], first)
    kept = np.delete(np.arange(length.size), split)
    kept = kept[np.argsort(stabilization.frequency_hz[chosen[kept]], kind="stable")]
    rows = chosen[kept]
    modes = Modes(
        stabilization.frequency_hz[rows],
        stabilization.damping_ratio[rows],
        stabilization.shapes[:, rows],
        stabilization.modes.outputs,
    ).normalized()
    places = [(int(n), complex(z)) for n, z in zip(stabilization.orders[rows], modes.poles, strict=True)]
    here, order = int(np.sum(position[k] >= 0)), int(orders[k])
    note = f"Of {orders.size} orders, {order} is the lowest with a pole for every mode that lasts: {here} of {len(modes)}."
    notes = (note, *(_on_split(stabilization.modes.frequency_hz[m]) for m in split))
    return Settled(order, modes, places, tuple((~lasting[kept]).tolist()), notes)


def brief_warnings(modes: Modes, brief: Sequence[bool]) -> tuple[str, ...]:
    """One sentence for each mode that is brief and whose damping is not told from zero.

    Args:
        modes: with standard deviations; without them nothing is said.
        brief: as of `Settled`.

    Returns:
        Warnings.
    """
    if modes.damping_std is None:
        return ()
    return tuple(
        f"The mode at {f:.4g} Hz shows at few orders only, with a damping ratio that is hardly told from zero "
        f"({100 * z:.2g} ± {100 * std:.1g} %): it may be noise."
        for f, z, std, few in zip(
            modes.frequency_hz, modes.damping_ratio, modes.damping_std, brief, strict=True
        )
        if few and z < 2 * std
    )


def _like_one_of(modes: Modes, lasting: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether each mode resembles one of those that last, other than itself, as chains that are joined do."""
    poles = Poles.of(modes)
    apart = difference(poles, poles.take(np.flatnonzero(lasting)), Thresholds())
    alike = (apart.frequency <= 1) & (apart.shape <= 1) & (apart.damping <= 2)
    return np.asarray(np.any(alike, axis=1))


def _on_split(frequency_hz: float) -> str:
    return f"A brief pole at {frequency_hz:.4g} Hz is taken for part of the lasting mode that it resembles."


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
