"""Sensors and actuators chosen together for a diagnosis: every set of actuators with the sensors that suit it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from identification.progress import UNHEARD, Work
from lab.placement.arena import Arena, closed
from lab.placement.candidates import Candidates, subsets
from lab.placement.contest import Layout
from lab.placement.plan import Plan
from lab.placement.search import count
from lab.placement.shapes import choose_actuators
from lab.rig import Rig

LIMIT = 200
"""Layouts of sensors up to this number are all compared for every set of actuators."""
MAX_SETS = 30
"""Sets of actuators that are compared at most: each takes a simulation of every cause."""


@dataclass(eq=False)
class Compared:
    """Layouts compared so far.

    Attributes:
        rig: with every candidate channel connected.
        plan: the test.
        everything: the causes where all actuators are at work.
        sensors, actuators: candidates.
        n_sensors, n_actuators: how many to choose.
        limit: as `LIMIT`.
        figures: of every layout compared.
        best: sensors and actuators of the best layout.
        arena: of its actuators.
        tried: sets of actuators, each with the figure of its best sensors.
        parallel: whether two causes were parallel in every set of actuators that shows both, shape (n_keys, n_keys).
        together: whether any set showed both.
    """

    rig: Rig
    plan: Plan
    everything: Arena
    sensors: Candidates
    actuators: Candidates
    n_sensors: int
    n_actuators: int
    limit: int = LIMIT
    figures: dict[Layout, float] = field(default_factory=dict)
    best: Layout = ((), ())
    arena: Arena = field(init=False)
    tried: dict[tuple[int, ...], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.everything.keys)
        self.arena, self.parallel, self.together = (
            self.everything,
            np.ones((n, n), dtype=bool),
            np.zeros((n, n), dtype=bool),
        )

    @property
    def n_sets(self) -> int:
        """Number of sets of actuators that there are."""
        return count(len(self.actuators), self.n_actuators, n_fixed=len(self.actuators.fixed))

    @property
    def n_layouts(self) -> int:
        """Number of layouts that there are."""
        return self.n_sets * count(len(self.sensors), self.n_sensors, n_fixed=len(self.sensors.fixed))

    @property
    def proven(self) -> bool:
        """Whether every layout was compared."""
        return len(self.figures) == self.n_layouts

    def search(self, work: Work = UNHEARD) -> None:
        """Compares all sets of actuators, or, of too many, those an exchange comes upon, the likeliest ones first."""
        if self.n_sets <= MAX_SETS:
            sets = subsets(len(self.actuators), self.n_actuators, self.actuators.fixed)
            for acting in work.each(sets, self.n_sets):
                self.look(acting)
            return
        # Actuators that drive every mode are a good start, whatever the causes.
        here = choose_actuators(self.rig, self.actuators, self.n_actuators)
        self.look(here)
        while (near := self._better(here, work)) is not None:
            here = near

    def look(self, acting: tuple[int, ...]) -> Arena:
        """Compares layouts of sensors where these actuators are at work."""
        arena = self.everything.under(self.rig, self.plan, self.actuators.channels_of(acting))
        if count(len(self.sensors), self.n_sensors, n_fixed=len(self.sensors.fixed)) <= self.limit:
            layouts = list(subsets(len(self.sensors), self.n_sensors, self.sensors.fixed))
        else:
            layouts = [fewer(arena, self.sensors, self.n_sensors)]
        for chosen in layouts:
            figure = self.figures[chosen, acting] = arena.figure(self.sensors.channels_of(chosen))
            if figure < self.figures.get(self.best, np.inf):
                self.best, self.arena = (chosen, acting), arena
        self.tried[acting] = min(self.figures[chosen, acting] for chosen in layouts)
        both = np.logical_and.outer(arena.present(), arena.present())
        self.parallel &= arena.parallel() | ~both
        self.together |= both
        return arena

    def inseparable(self) -> np.ndarray:
        """Whether no layout tells two causes apart, shape (n_keys, n_keys)."""
        if len(self.tried) == self.n_sets:
            return closed(self.parallel & self.together)
        # Of sets that were not looked at, all actuators together know most.
        return closed(self.parallel & self.everything.alike)

    def _better(self, here: tuple[int, ...], work: Work) -> tuple[int, ...] | None:
        """A set of actuators with one exchanged that is better; None when there is none, or enough were tried."""
        loose = [i for i in here if i not in self.actuators.fixed]
        for old, new in product(loose, [i for i in range(len(self.actuators)) if i not in here]):
            near = tuple(sorted({*here, new} - {old}))
            if near in self.tried:
                continue
            if len(self.tried) >= MAX_SETS:
                return None
            self.look(near)
            work.done(len(self.tried) / MAX_SETS)
            if self.tried[near] < self.tried[here] * (1 - 1e-9):
                return near
        return None


def fewer(arena: Arena, sensors: Candidates, n: int) -> tuple[int, ...]:
    """Sensors left when those that help least are taken away one by one, then exchanged while that helps."""
    chosen = list(range(len(sensors)))

    def value(choice: Sequence[int]) -> float:
        return arena.figure(sensors.channels_of(choice))

    while len(chosen) > n:
        loose = [i for i in chosen if i not in sensors.fixed]
        least = min(loose, key=lambda i: value([j for j in chosen if j != i]))
        chosen.remove(least)
    best, improved = value(chosen), True
    while improved:
        improved = False
        for old in [i for i in chosen if i not in sensors.fixed]:
            rest = [i for i in range(len(sensors)) if i not in chosen]
            trials = {new: value(sorted({*chosen, new} - {old})) for new in rest}
            new = min(trials, key=lambda i: trials[i]) if trials else old
            if trials and trials[new] < best * (1 - 1e-9):
                chosen, best, improved = sorted({*chosen, new} - {old}), trials[new], True
    return tuple(chosen)


def groups(alike: np.ndarray) -> Iterator[tuple[int, ...]]:
    """Numbers of causes that are alike, two or more at a time."""
    seen: set[int] = set()
    for k, row in enumerate(alike):
        members = tuple(int(i) for i in np.flatnonzero(row))
        if len(members) > 1 and k not in seen:
            seen |= set(members)
            yield members
