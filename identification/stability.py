"""Which poles of models of rising order are the structure's own: those that stay put; and why the others went.

A model of too high an order fits the noise as well, with poles that move from one order to the next. Each
pole is compared with the nearest one of the next lower order; poles that follow one another form chains;
chains of one pole are joined to clusters; and the long clusters are the modes.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from identification.clusters import (
    Indices,
    Poles,
    Thresholds,
    cluster_means,
    cluster_scatter,
    difference,
    join,
    keep_long,
)
from identification.errors import IdentificationError
from identification.modes import Complex, Modes, modal_phase_collinearity, oscillating
from identification.recording import Array, frozen
from identification.systems import Realization

STABLE = "stable"

RULES = {
    "negative damping": "The pole grows in time.",
    "damping too high": "The damping ratio exceeds max_damping: hardly an oscillation.",
    "complex shape": "The modal phase collinearity of the shape is below min_collinearity.",
    "lowest order": "There is no lower order to compare with.",
    "frequency jumps": "The nearest pole of the next lower order is farther away than the tolerances allow.",
    "shape jumps": "The MAC with the nearest pole of the next lower order is below min_mac.",
    "damping jumps": "The damping differs from the nearest pole's by more than both tolerances.",
    "double": "Another pole of the same order is nearer to the pole that this one resembles.",
    "cluster too small": "The pole agrees with lower orders, but at too few of them to be told from chance.",
}
"""Why a pole is not taken for the structure's own; the first rule that applies gives the label."""

NAMES = (STABLE, *RULES)


@dataclass(frozen=True, eq=False, repr=False)
class Stabilization:
    """Every oscillating pole of every order, what became of it, and the modes that remain.

    Attributes:
        orders: order of the model that each pole comes from, rising, shape (n_poles,).
        frequency_hz: shape (n_poles,).
        damping_ratio: shape (n_poles,).
        shapes: of length one, shape (n_outputs, n_poles).
        label: "stable", or the rule of `RULES` that rejected the pole.
        cluster: position of the pole's mode in `modes`, -1 for none, shape (n_poles,).
        modes: mean of each cluster, sorted by frequency.
        frequency_scatter: standard deviation over the orders [Hz], shape (n_modes,). It tells how much the choice
            of the order matters, not how far a mode may be from the truth.
        damping_scatter: likewise of the damping ratio, shape (n_modes,).
    """

    orders: Indices
    frequency_hz: Array
    damping_ratio: Array
    shapes: Complex
    label: tuple[str, ...]
    cluster: Indices
    modes: Modes
    frequency_scatter: Array
    damping_scatter: Array

    def __post_init__(self) -> None:
        for name in ("frequency_hz", "damping_ratio", "frequency_scatter", "damping_scatter"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        for name in ("orders", "shapes", "cluster"):
            array = np.array(getattr(self, name))
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __repr__(self) -> str:
        n_stable = sum(label == STABLE for label in self.label)
        return f"Stabilization({len(self.label)} poles, {n_stable} stable, {len(self.modes)} modes)"


def stabilize(realization: Realization, **thresholds: float) -> Stabilization:
    """The poles of all orders, each with a verdict, and the modes made of those that stay put.

    Args:
        realization: models of several orders.
        **thresholds: fields of `Thresholds` that shall differ from their defaults.

    Returns:
        All oscillating poles, and modes sorted by frequency with the largest component of each shape one.

    Raises:
        IdentificationError: there is no threshold of that name.

    Source: Peeters and De Roeck (2001), J. Dyn. Syst. Meas. Control 123, the stabilization diagram: from one order to
        the next |Δf| / f, |Δζ| / ζ and 1 - MAC stay within tolerances.
    """
    names = [field.name for field in fields(Thresholds)]
    unknown = sorted(set(thresholds) - set(names))
    if unknown:
        raise IdentificationError(f"there is no threshold {unknown[0]!r}; expected one of {', '.join(names)}")
    limits = Thresholds(**thresholds)
    poles = _all_poles(realization)
    rule, chain = _follow(poles, limits)
    cluster = keep_long(join(poles, chain, limits))
    rule[(chain >= 0) & (cluster < 0)] = NAMES.index("cluster too small")
    cluster, mean = _sorted_means(poles, cluster)
    modes = Modes(
        mean.frequency_hz,
        mean.damping_ratio,
        mean.shapes,
        realization.systems[0].outputs,
    )
    return Stabilization(
        *poles,
        tuple(NAMES[k] for k in rule),
        cluster,
        modes.normalized(),
        cluster_scatter(poles.frequency_hz, cluster),
        cluster_scatter(poles.damping_ratio, cluster),
    )


def _sorted_means(poles: Poles, cluster: Indices) -> tuple[Indices, Poles]:
    """Clusters renumbered by rising frequency, and their means in that order."""
    mean = cluster_means(poles, cluster)
    rank = np.argsort(mean.frequency_hz, kind="stable")
    number = np.append(np.argsort(rank), -1)  # the last one serves the poles without a cluster
    return number[cluster], mean.take(rank)


def _all_poles(realization: Realization) -> Poles:
    """One pole of each conjugate pair of every model, by rising order; real poles do not oscillate."""
    systems = realization.systems
    found = [system.eigen() for system in systems]
    shapes = [system.C @ vectors for system, (_, vectors) in zip(systems, found, strict=True)]
    order = np.repeat(realization.orders, realization.orders)
    poles = np.concatenate([each for each, _ in found])
    own = np.flatnonzero(oscillating(poles, systems[0].dt))
    omega = np.abs(poles[own])
    rank = np.lexsort((omega, order[own]))
    own, omega = own[rank], omega[rank]
    return Poles.normalized(
        order[own], omega / (2 * np.pi), -poles[own].real / omega, np.concatenate(shapes, axis=1)[:, own]
    )


def _follow(poles: Poles, limits: Thresholds) -> tuple[Indices, Indices]:
    """The first rule against each pole, as a position in `NAMES`, and the number of its chain, -1 for none."""
    rule = _first(
        {
            "negative damping": poles.damping_ratio < 0,
            "damping too high": poles.damping_ratio > limits.max_damping,
            "complex shape": modal_phase_collinearity(poles.shapes) < limits.min_collinearity,
        }
    )
    left = np.flatnonzero(rule == 0)
    mate, far, double = _nearest_below(poles.take(left), limits)
    rule[left] = _first(
        {
            "lowest order": mate < 0,
            "frequency jumps": far[0] > 1,
            "shape jumps": far[1] > 1,
            "damping jumps": far[2] > 1,
            "double": double,
        }
    )
    # A chain is named by the pole before its first; following the links twice as far each time finds it.
    follows = rule[left] == 0
    start = np.where(follows, mate, np.arange(left.size))
    for _ in range(left.size.bit_length()):
        start = start[start]
    chain = np.full(rule.size, -1)
    chain[left[follows]] = np.unique(start[follows], return_inverse=True)[1]
    return rule, chain


def _nearest_below(poles: Poles, limits: Thresholds) -> tuple[Indices, Array, NDArray[np.bool_]]:
    """The nearest pole of the next lower order, -1 for none; how far it is; and whether another pole is nearer.

    Returns:
        Positions, shape (n_poles,); frequency, shape and damping over what is allowed, shape (3, n_poles); and
        whether the lower pole has a nearer one among those of this pole's order, shape (n_poles,).
    """
    mate, far = np.full(poles.order.size, -1), np.zeros((3, poles.order.size))
    double = np.zeros(poles.order.size, dtype=bool)
    borders = np.flatnonzero(np.diff(poles.order, prepend=-1))
    if borders.size < 2:
        return mate, far, double
    stack, row, column = _by_order(poles, borders)
    below, above = (
        Poles(stack.order[k], stack.frequency_hz[k], stack.damping_ratio[k], stack.shapes[k])
        for k in (slice(-1), slice(1, None))
    )
    apart = difference(above, below, limits)
    distance = np.where(np.isnan(apart.distance), np.inf, apart.distance)  # (n_orders - 1, width, width)
    own = slice(borders[1], None)
    upper, place = row[own] - 1, column[own]
    nearest = np.argmin(distance, axis=2)[upper, place]
    mate[own] = borders[upper] + nearest
    far[:, own] = [each[upper, place, nearest] for each in apart[:3]]
    double[own] = np.argmin(distance, axis=1)[upper, nearest] != place
    return mate, far, double


def _by_order(poles: Poles, borders: Indices) -> tuple[Poles, Indices, Indices]:
    """A row of poles for each order, filled up with NaN, and the row and column of each pole."""
    size = np.diff(borders, append=poles.order.size)
    row = np.repeat(np.arange(size.size), size)
    column = np.arange(poles.order.size) - borders[row]
    frequency, damping = np.full((2, size.size, np.max(size)), np.nan)
    frequency[row, column], damping[row, column] = poles.frequency_hz, poles.damping_ratio
    shapes = np.zeros((size.size, len(poles.shapes), np.max(size)), complex)
    shapes[row, :, column] = poles.shapes.T
    return Poles(poles.order[borders], frequency, damping, shapes), row, column


def _first(rules: dict[str, NDArray[np.bool_]]) -> Indices:
    """Position in `NAMES` of the first rule that applies to each pole; 0 where none does."""
    numbers = np.array([NAMES.index(name) for name in rules])
    broken = np.array(list(rules.values()))
    return np.where(broken.any(axis=0), numbers[np.argmax(broken, axis=0)], 0)
