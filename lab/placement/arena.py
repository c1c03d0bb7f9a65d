"""Arena: causes, their effects in the metric of noise and calibration, and how easily one is named for another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.recording import Array
from lab.placement.confusion import confusion, lengths_and_cosines, mistaken, without
from lab.placement.plan import Plan, driving_level
from lab.placement.suspects import Suspects, suspects
from lab.rig import Rig

PARALLEL = 1e-4
"""Two effects at a smaller angle, squared, cannot be told apart in any test of reasonable length."""
OFF = 5.0
"""A parameter that is a cause is off by so many of its tolerances: within one, it is calibration and no cause."""


@dataclass(frozen=True, eq=False)
class Arena:
    """Causes in a test with some of the actuators, and how well each layout of sensors tells them apart.

    Attributes:
        suspects: effects of the causes.
        sizes: of each effect, as a multiple of the probe.
        noise_std: of each output, shape (n_outputs,).
        products: of slopes and effects at each output, over its noise; (n_outputs, n, n), slopes first.
        keys: the causes, each once.
        of_key: number of the cause of each effect.
        alike: whether no test of these outputs, all actuators at work, tells two causes apart, shape (n_keys, n_keys).
    """

    suspects: Suspects
    sizes: Array
    noise_std: Array
    products: Array
    keys: tuple[tuple[str, str], ...]
    of_key: np.ndarray
    alike: np.ndarray

    @cached_property
    def acting(self) -> np.ndarray:
        """Whether all actuators that the cause of an effect sits in are at work, shape (n_effects,)."""
        return np.array([set(drives) <= set(self.suspects.acting) for drives in self.suspects.drives])

    def compared(self, channels: Sequence[int]) -> tuple[Array, Array, np.ndarray]:
        """Lengths and cosines of all effects, and which of them are suspects, where these outputs are connected."""
        total = self.products[list(channels)].sum(axis=0)
        length, cosine = lengths_and_cosines(
            without(total, len(self.suspects.slopes), self.suspects.precision)
        )
        here = np.array([set(needs) <= set(channels) for needs in self.suspects.needs])
        return length, cosine, here & self.acting

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

    def mistakes(self, channels: Sequence[int]) -> Array:
        """For every cause the probability of naming any wrong one, from drawn data, shape (n_keys,); nan as above."""
        length, cosine, here = self.compared(channels)
        rows = np.flatnonzero(here)
        owner = self.of_key[rows]
        wrong = mistaken(length[rows], cosine[np.ix_(rows, rows)], self.alike[np.ix_(owner, owner)])
        found = np.full(len(self.keys), np.nan)
        np.fmax.at(found, owner, wrong)
        return found

    def under(self, rig: Rig, plan: Plan, acting: Sequence[int]) -> Arena:
        """The same causes at the same physical sizes where only some of the actuators are at work."""
        return self.driven(rig, plan, acting, None)

    def driven(self, rig: Rig, plan: Plan, acting: Sequence[int], noise_std: Array | None) -> Arena:
        """The same causes in another test; its noise is as planned when none is given."""
        found = suspects(rig, plan, acting=acting, like=self.suspects)
        std = noise_of(rig, plan, found.outputs) if noise_std is None else noise_std
        return replace(self, suspects=found, noise_std=std, products=products_of(found, std, self.sizes))

    def parallel(self) -> np.ndarray:
        """Whether the effects of two causes are parallel at all outputs together, shape (n_keys, n_keys)."""
        first, n = len(self.suspects.slopes), len(self.keys)
        length, cosine = lengths_and_cosines(self.products.sum(axis=0)[first:, first:])
        same = np.eye(n, dtype=bool)
        for i, j in np.argwhere((1 - cosine**2 < PARALLEL) & (length > 0) & (length[:, None] > 0)):
            same[self.of_key[i], self.of_key[j]] = same[self.of_key[j], self.of_key[i]] = True
        return same

    def present(self) -> np.ndarray:
        """Whether each cause sits in nothing that rests, shape (n_keys,)."""
        found = np.zeros(len(self.keys), dtype=bool)
        found[self.of_key[self.acting]] = True
        return found


def arena_of(
    rig: Rig, plan: Plan, size: float, causes: Sequence[str], *, n_acting: int | None = None
) -> Arena:
    """The causes at the size asked for, where all actuators are at work.

    Args:
        rig: with the candidates connected.
        plan: the test.
        size: RMS change of the outputs, as a share of their RMS.
        causes: names; the whole catalogue when empty.
        n_acting: how many of the actuators the test will have: all together are driven as much less, so that stops, slack
            and friction are of a size that it reaches. All when None.
    """
    if n_acting is not None and n_acting < len(rig.inputs):
        plan = plan.driven(driving_level(plan.excitation, np.sqrt(n_acting / len(rig.inputs))))
    found = suspects(rig, plan, causes=causes)
    std = noise_of(rig, plan, found.outputs)
    power = np.mean(found.outputs**2, axis=1)
    felt = power > 0
    change = np.mean(found.effects[:, felt] ** 2, axis=2) / power[felt]
    sizes = size / np.sqrt(np.mean(change, axis=1))
    # Channels are swapped or not: that has no size.
    for i, probe in enumerate(found.probes):
        if isinstance(probe, int):
            sizes[i] = OFF
        elif not probe.n:
            sizes[i] = 1.0
    keys = tuple(dict.fromkeys(found.keys))
    of_key = np.array([keys.index(key) for key in found.keys])
    arena = Arena(
        found, sizes, std, products_of(found, std, sizes), keys, of_key, np.eye(len(keys), dtype=bool)
    )
    return replace(arena, alike=closed(arena.parallel()))


def noise_of(rig: Rig, plan: Plan, outputs: Array) -> Array:
    """Standard deviation of the noise of each output, shape (n_outputs,)."""
    return plan.noise_std(rig.outputs, np.sqrt(np.mean(outputs**2, axis=1))[None])[0]


def products_of(found: Suspects, noise_std: Array, sizes: Array) -> Array:
    """Products of slopes and sized effects at each output, over its noise, shape (n_outputs, n, n)."""
    columns = np.concatenate([found.slopes, found.effects * sizes[:, None, None]])
    return np.stack([x @ x.T / s**2 for x, s in zip(columns.transpose(1, 0, 2), noise_std, strict=True)])


def closed(alike: np.ndarray) -> np.ndarray:
    """What is alike to one is alike to all that it is alike to; shape (n, n)."""
    while True:
        wider = (alike.astype(int) @ alike.astype(int)) > 0
        if np.array_equal(wider, alike):
            return alike
        alike = wider
