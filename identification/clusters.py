"""Poles of one mode, gathered over the orders, and the mean that stands for them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.modes import Complex, Modes
from identification.recording import Array

Indices = NDArray[np.intp]

MIN_LENGTH = 3
"""Fewest poles of a mode: two may agree by chance, and tell nothing about a scatter."""


@dataclass(frozen=True)
class Thresholds:
    """When two poles count as the same, and when a pole counts as no oscillation at all.

    Attributes:
        frequency_tolerance: largest relative difference of frequency. A larger one passes as far as
            damping_tolerance times the damping ratio, since a pole scatters along frequency as much as along
            damping [rad/s].
        damping_tolerance: largest relative difference of damping.
        damping_step: a smaller difference of the damping ratio passes too, since the relative scatter of
            light damping is large in any record.
        min_mac: smallest modal assurance criterion between the shapes.
        max_damping: largest damping ratio of a mode.
        min_collinearity: smallest modal phase collinearity; 0 lets complex modes pass.
    """

    frequency_tolerance: float = 0.01
    damping_tolerance: float = 0.2
    damping_step: float = 0.002
    min_mac: float = 0.9
    max_damping: float = 0.2
    min_collinearity: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0 <= value < 1 or (value == 0 and not field.name.startswith("min")):
                raise IdentificationError(
                    f"threshold {field.name} is {value}; expected a number between 0 and 1"
                )


class Poles(NamedTuple):
    """Oscillating poles.

    Attributes:
        order: of the model each pole comes from, rising, shape (n_poles,).
        frequency_hz: shape (n_poles,).
        damping_ratio: shape (n_poles,).
        shapes: of length one, shape (n_outputs, n_poles).
    """

    order: Indices
    frequency_hz: Array
    damping_ratio: Array
    shapes: Complex

    @classmethod
    def of(cls, modes: Modes) -> Poles:
        """The poles of modes, all of one order."""
        order = np.zeros(len(modes), dtype=np.intp)
        return cls.normalized(order, modes.frequency_hz, modes.damping_ratio, modes.shapes)

    @classmethod
    def normalized(cls, order: Indices, frequency_hz: Array, damping_ratio: Array, shapes: Complex) -> Poles:
        """The poles with shapes of any length brought to length one."""
        length = np.linalg.norm(shapes, axis=0)
        return cls(order, frequency_hz, damping_ratio, shapes / np.where(length == 0, 1, length))

    def take(self, which: Indices | slice) -> Poles:
        """The poles at the given positions."""
        return Poles(
            self.order[which], self.frequency_hz[which], self.damping_ratio[which], self.shapes[:, which]
        )


class Difference(NamedTuple):
    """How far the poles of one set are from those of another, each entry of shape (n_a, n_b).

    Attributes:
        frequency: over what is allowed; more than one is too far.
        shape: 1 - MAC over what is allowed.
        damping: over what is allowed.
        distance: one number to find the nearest by: distance in the complex plane and of the shapes.
    """

    frequency: Array
    shape: Array
    damping: Array
    distance: Array


def difference(a: Poles, b: Poles, limits: Thresholds) -> Difference:
    """How far the poles `a` are from the poles `b`.

    Args:
        a: poles of one order, or a stack of them along further axes in front.
        b: poles of another one, likewise.
        limits: what is allowed.

    Returns:
        Differences in parts of what is allowed, and the distance, shape (…, n_a, n_b) each.

    Source: the distance is that of Reynders, Houbrechts and De Roeck (2012), Mech. Syst. Signal Process. 29,
        |λ_a - λ_b| / |λ| + 1 - MAC, with each part divided by what is allowed.
    """
    f, z = a.frequency_hz[..., :, None], a.damping_ratio[..., :, None]
    f_b, z_b = b.frequency_hz[..., None, :], b.damping_ratio[..., None, :]
    allowed = np.maximum(limits.frequency_tolerance, limits.damping_tolerance * z)
    frequency = np.abs(f - f_b) / (allowed * f)
    step = np.abs(z - z_b)
    damping = step / np.maximum(limits.damping_tolerance * z, limits.damping_step)
    shape = (1 - np.abs(a.shapes.conj().mT @ b.shapes) ** 2) / (1 - limits.min_mac)
    plane = np.hypot(frequency, step / allowed)
    return Difference(frequency, shape, damping, plane + shape)


def join(poles: Poles, chain: Indices, limits: Thresholds) -> Indices:
    """Number of the cluster of each pole, -1 for none: chains of the same pole joined where orders are missing.

    Two chains are of the same pole when their means are within the thresholds and no order has a pole of
    both: two poles of one order are two modes, however close. The nearest pairs are joined first.

    Args:
        poles: all poles.
        chain: number of each pole's chain, -1 for none.
        limits: as for one order to the next.

    Returns:
        Shape (n_poles,).
    """
    mean = cluster_means(poles, chain)
    n = mean.frequency_hz.size
    orders, row = np.unique(poles.order, return_inverse=True)
    present = np.zeros((n, orders.size), dtype=bool)
    present[chain[chain >= 0], row[chain >= 0]] = True
    apart = difference(mean, mean, limits)
    # Damping drifts most from order to order, so that the means of two chains may be off on either side.
    same = (apart.frequency <= 1) & (apart.shape <= 1) & (apart.damping <= 2)
    same &= ~(present.astype(float) @ present.T.astype(float) > 0)
    first, second = np.nonzero(np.triu(same, 1))
    root = np.arange(n)
    for k in np.argsort(apart.distance[first, second], kind="stable"):
        a, b = root[first[k]], root[second[k]]
        if a != b and not np.any(present[a] & present[b]):
            present[a] |= present[b]
            root[root == b] = a
    number = np.append(np.unique(root, return_inverse=True)[1], -1)  # the last one serves poles of no chain
    return number[chain]


def keep_long(cluster: Indices) -> Indices:
    """Numbers of the clusters that are long enough to be modes, renumbered; -1 for the poles of all others.

    The lengths are split into two classes, each around its own mean, as modes last over most orders and
    chance agreements over few. They are counts, so their square roots are compared, which scatter alike.
    The class of the
    short ones holds an empty cluster besides: where nothing agrees by chance, it must not take the shorter
        modes.

    Args:
        cluster: number of the cluster of each pole, -1 for none, shape (n_poles,).

    Returns:
        Shape (n_poles,).

    Source: two-means clustering as in Reynders, Houbrechts and De Roeck (2012), third stage.
    """
    if not np.any(cluster >= 0):
        return cluster
    length = np.bincount(cluster[cluster >= 0])
    size = np.sqrt(length)
    border, last = float(np.max(size)) / 2, -1.0
    while border != last:
        is_long = size > border
        short = np.sum(size[~is_long]) / (1 + np.sum(~is_long))
        border, last = (short + np.mean(size[is_long])) / 2, border
    is_long = (size > border) & (length >= MIN_LENGTH)
    number = np.append(np.where(is_long, np.cumsum(is_long) - 1, -1), -1)
    return number[cluster]


def cluster_means(poles: Poles, cluster: Indices) -> Poles:
    """The mean of each cluster, with its highest order; shapes are turned to the phase of that one first.

    Args:
        poles: all poles, by rising order.
        cluster: number of the cluster of each pole, -1 for none, shape (n_poles,).

    Returns:
        One pole per cluster, with a shape of length one.
    """
    member = np.flatnonzero(cluster >= 0)
    own = cluster[member]
    n = int(np.max(own, initial=-1)) + 1
    highest = np.zeros(n, dtype=np.intp)
    highest[own] = member  # poles come by rising order, so that the last one written stays
    part = poles.take(member)
    share = np.zeros((member.size, n))
    share[np.arange(member.size), own] = 1 / np.bincount(own, minlength=n)[own]
    turn = np.sum(part.shapes.conj() * poles.shapes[:, highest[own]], axis=0)
    shapes = (part.shapes * np.exp(1j * np.angle(turn))) @ share
    return Poles(
        poles.order[highest],
        part.frequency_hz @ share,
        part.damping_ratio @ share,
        shapes / np.linalg.norm(shapes, axis=0),
    )


def cluster_scatter(values: Array, cluster: Indices) -> Array:
    """Standard deviation of the values in each cluster of two or more, shape (n_clusters,).

    Args:
        values: one per pole, shape (n_poles,).
        cluster: number of the cluster of each pole, -1 for none, shape (n_poles,).

    Returns:
        In the unit of the values.
    """
    own, values = cluster[cluster >= 0], values[cluster >= 0]
    size = np.bincount(own)
    mean = np.bincount(own, values) / size
    return np.asarray(np.sqrt(np.bincount(own, (values - mean[own]) ** 2) / (size - 1)))
