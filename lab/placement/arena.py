"""Arena: causes, their effects in the metric of noise and calibration, and how easily one is named for another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.recording import Array
from lab.placement.confusion import confusion, lengths_and_cosines, without
from lab.placement.plan import Plan
from lab.placement.suspects import Suspects, suspects
from lab.rig import Rig

PARALLEL = 1e-4
"""Two effects at a smaller angle, squared, cannot be told apart in any test of reasonable length."""
OFF = 5.0
"""A parameter that is a cause is off by so many of its tolerances: within one, it is calibration and no cause."""


@dataclass(frozen=True, eq=False)
class Arena:
    """Causes, and how well each layout tells them apart.

    Attributes:
        suspects: effects of the causes.
        sizes: of each effect, as a multiple of the probe.
        products: of slopes and effects at each output, over its noise; (n_outputs, n, n), slopes first.
        keys: the causes, each once.
        of_key: number of the cause of each effect.
        alike: whether two causes cannot be told apart, shape (n_keys, n_keys).
    """

    suspects: Suspects
    sizes: Array
    products: Array
    keys: tuple[tuple[str, str], ...]
    of_key: np.ndarray
    alike: np.ndarray

    @classmethod
    def of(cls, found: Suspects, noise_std: Array, sizes: Array) -> Arena:
        """The arena of causes with effects of these sizes."""
        products = products_of(found, noise_std, sizes)
        keys = tuple(dict.fromkeys(found.keys))
        of_key = np.array([keys.index(key) for key in found.keys])
        arena = cls(found, sizes, products, keys, of_key, np.eye(len(keys), dtype=bool))
        return replace(arena, alike=arena._alike())

    def compared(self, channels: Sequence[int]) -> tuple[Array, Array, np.ndarray]:
        """Lengths and cosines of all effects, and which of them are suspects, where these outputs are connected."""
        total = self.products[list(channels)].sum(axis=0)
        length, cosine = lengths_and_cosines(
            without(total, len(self.suspects.slopes), self.suspects.precision)
        )
        here = np.array([set(needs) <= set(channels) for needs in self.suspects.needs])
        return length, cosine, here

    def confusions(self, channels: Sequence[int]) -> tuple[Array, Array, np.ndarray]:
        """For every cause: length of its least visible effect, its likeliest confusion, and the rival, -1 for none.

        Causes in channels that are not connected have the confusion nan.
        """
        length, cosine, here = self.compared(channels)
        P = confusion(length[:, None], cosine)
        P[:, ~here] = 0.0
        P[self.alike[np.ix_(self.of_key, self.of_key)]] = 0.0
        rival, worst = np.argmax(P, axis=1), np.max(P, axis=1)
        n = len(self.keys)
        visible, confused, whose = np.full(n, np.nan), np.full(n, np.nan), np.full(n, -1)
        for i in np.flatnonzero(here):
            k = self.of_key[i]
            if not confused[k] >= worst[i]:
                confused[k], whose[k] = worst[i], self.of_key[rival[i]] if worst[i] > 0 else -1
            visible[k] = np.nanmin([visible[k], length[i]])
        return visible, confused, whose

    def figure(self, channels: Sequence[int]) -> float:
        """Mean over the causes of the likeliest confusion."""
        return float(np.nanmean(self.confusions(channels)[1]))

    def _alike(self) -> np.ndarray:
        """Causes whose effects are parallel at all outputs together; alike to one is alike to all that it is alike to."""
        first = len(self.suspects.slopes)
        cosine = lengths_and_cosines(self.products.sum(axis=0)[first:, first:])[1]
        n = len(self.keys)
        alike = np.eye(n, dtype=bool)
        for i, j in np.argwhere(1 - cosine**2 < PARALLEL):
            alike[self.of_key[i], self.of_key[j]] = alike[self.of_key[j], self.of_key[i]] = True
        while True:
            wider = (alike.astype(int) @ alike.astype(int)) > 0
            if np.array_equal(wider, alike):
                return alike
            alike = wider


def arena_of(rig: Rig, plan: Plan, size: float, causes: Sequence[str]) -> tuple[Arena, Array]:
    """The causes at the size asked for, and the noise of every output."""
    found = suspects(rig, plan, causes=causes)
    power = np.mean(found.outputs**2, axis=1)
    std = plan.noise_std(rig.outputs, np.sqrt(power)[None])[0]
    felt = power > 0
    change = np.mean(found.effects[:, felt] ** 2, axis=2) / power[felt]
    sizes = size / np.sqrt(np.mean(change, axis=1))
    # Channels are swapped or not: that has no size.
    for i, probe in enumerate(found.probes):
        if isinstance(probe, int):
            sizes[i] = OFF
        elif not probe.n:
            sizes[i] = 1.0
    return Arena.of(found, std, sizes), std


def products_of(found: Suspects, noise_std: Array, sizes: Array) -> Array:
    """Products of slopes and sized effects at each output, over its noise, shape (n_outputs, n, n)."""
    columns = np.concatenate([found.slopes, found.effects * sizes[:, None, None]])
    return np.stack([x @ x.T / s**2 for x, s in zip(columns.transpose(1, 0, 2), noise_std, strict=True)])
