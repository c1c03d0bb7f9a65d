"""Extremes: how often a channel sits exactly at its largest and smallest values, and at those next to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.recording import Array
from lab.checks.levels import Blocks, Levels

MARGIN = 0.05
"""Share of the range, next to each end, in which values are counted."""


@dataclass(frozen=True)
class End:
    """One end of a channel's range.

    Attributes:
        level: the value there.
        count: samples exactly there.
        visits: separate stays there.
        next_count: samples at the value next to it, or the most at any of the next four.
        near: samples next to the level and not at it.
        first: first sample there.
        last: last sample there.
    """

    level: float
    count: int
    visits: int
    next_count: int
    near: int
    first: int
    last: int


@dataclass(frozen=True)
class Extremes:
    """The two ends of a channel's range."""

    low: End
    high: End


class _Tally:
    """Counts of values near one end of one channel."""

    def __init__(self, level: float, edge: float, sign: int) -> None:
        self.level, self.edge, self.sign = level, edge, sign
        self.values: dict[float, int] = {}
        self.visits, self.first, self.last, self.inside = 0, -1, -2, 0

    def add(self, x: Array, at: int) -> None:
        inside = np.flatnonzero(self.sign * x >= self.sign * self.edge)
        if not inside.size:
            return
        self.inside += inside.size
        values, counts = np.unique(x[inside], return_counts=True)
        # Ten values from the end are more than enough, whatever the number of blocks.
        keep = slice(-10, None) if self.sign > 0 else slice(0, 10)
        for value, count in zip(values[keep].tolist(), counts[keep].tolist(), strict=True):
            self.values[value] = self.values.get(value, 0) + count
        there = at + inside[x[inside] == self.level]
        if there.size:
            self.visits += int(np.sum(np.diff(there) > 1)) + int(there[0] > self.last + 1)
            self.first = int(there[0]) if self.first < 0 else self.first
            self.last = int(there[-1])

    def end(self) -> End:
        others = sorted((v for v in self.values if v != self.level), key=lambda v: abs(v - self.level))[:4]
        most = max((self.values[v] for v in others), default=0)
        count = self.values.get(self.level, 0)
        return End(self.level, count, self.visits, most, self.inside - count, self.first, max(self.last, 0))


def extremes_of(blocks: Blocks, levels: Levels) -> tuple[Extremes, ...]:
    """Extremes of every channel of a record whose levels are known."""
    span = MARGIN * (levels.highest - levels.lowest)
    lows = [_Tally(a, a + s, -1) for a, s in zip(levels.lowest.tolist(), span.tolist(), strict=True)]
    highs = [_Tally(b, b - s, 1) for b, s in zip(levels.highest.tolist(), span.tolist(), strict=True)]
    at = 0
    for x in blocks():
        for row, (low, high) in enumerate(zip(lows, highs, strict=True)):
            low.add(x[row], at)
            high.add(x[row], at)
        at += x.shape[1]
    return tuple(Extremes(low.end(), high.end()) for low, high in zip(lows, highs, strict=True))
