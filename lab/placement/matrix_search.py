"""A good layout for M, C and K where there are too many to compare: exchanges from several starts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import product

import numpy as np

from identification.progress import UNHEARD, Work
from lab.errors import LabError
from lab.placement.candidates import Candidates
from lab.placement.contest import Contest, Layout, figure, impossible

STARTS = 4


def searched(contest: Contest, work: Work = UNHEARD) -> Layout:
    """A good layout where there are too many to compare: exchanges of a sensor, an actuator or both from several starts."""
    rng, found = np.random.default_rng(0), []
    by_sensor = lru_cache(maxsize=128)(contest.by_sensor)

    def value(layout: Layout) -> float:
        return figure(by_sensor(layout[1])[list(layout[0])].sum(axis=0), contest.criterion)

    for _ in work.each(range(STARTS)):
        here = _any_possible(contest, rng)
        best = value(here)
        while True:
            lowest, near = min(
                ((value(near), near) for near in _neighbours(contest, here)), default=(best, here)
            )
            if not lowest < best:
                break
            best, here = lowest, near
        found.append((best, here))
    return min(found)[1]


def _neighbours(contest: Contest, layout: Layout) -> Iterator[Layout]:
    """Possible layouts that differ in one sensor, one actuator, or one of each, as when the two trade places."""
    sensors, actuators = (
        [here, *(tuple(sorted({*here, new} - {old})) for old, new in _trades(here, candidates))]
        for here, candidates in zip(layout, (contest.sensors, contest.actuators), strict=True)
    )
    for near in product(sensors, actuators):
        if near != layout and contest.possible(near):
            yield near


def _trades(chosen: Sequence[int], candidates: Candidates) -> Iterator[tuple[int, int]]:
    """One to take away and one to take in its place."""
    loose = [i for i in chosen if i not in candidates.fixed]
    return product(loose, [i for i in range(len(candidates)) if i not in chosen])


def _any_possible(contest: Contest, rng: np.random.Generator) -> Layout:
    """A possible layout at random: actuators first, then sensors on what they leave bare and on one that they drive."""
    for _ in range(1000):
        sides: list[tuple[int, ...]] = []
        for candidates, n in ((contest.actuators, contest.n_actuators), (contest.sensors, contest.n_sensors)):
            free = rng.permutation([i for i in range(len(candidates)) if i not in candidates.fixed])
            if sides:
                driven = contest.held(((), sides[0]))[1]
                dofs = [contest.rig.outputs[candidates.channels[i][0]].dof for i in free]
                bare = {dof for dof, is_driven in zip(contest.rig.dofs, driven, strict=True) if not is_driven}
                first = [i for k, i in enumerate(free) if dofs[k] in bare and dofs[k] not in dofs[:k]]
                free = np.array([*first, *(i for i in free if i not in first)])
            sides.append(
                tuple(sorted(int(i) for i in (*candidates.fixed, *free[: n - len(candidates.fixed)])))
            )
        if contest.possible((sides[1], sides[0])):
            return sides[1], sides[0]
    raise LabError(impossible(contest))
