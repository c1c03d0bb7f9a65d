"""Roving sensors: which of them measure together, so that every set-up sees every mode."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product

import numpy as np

from identification.recording import Array
from lab.placement.criteria import CRITERIA


def arranged(grams: Array, chosen: Sequence[int], stay: Sequence[int], setups: int) -> list[tuple[int, ...]]:
    """Sensors of each set-up, references first.

    Rovers trade places between set-ups while the set-up that sees its faintest mode worst gains.

    Args:
        grams: what each block brings, shape (n_blocks, m, m).
        chosen: all sensors.
        stay: references, which are in every set-up.
        setups: number of set-ups.
    """
    rest = [i for i in chosen if i not in stay]
    per = len(rest) // setups
    groups = [list(rest[k * per : (k + 1) * per]) for k in range(setups)]
    best, improved = _seen(grams, stay, groups), True
    while improved:
        improved = False
        for (a, b), (i, j) in product(combinations(range(setups), 2), product(range(per), repeat=2)):
            groups[a][i], groups[b][j] = groups[b][j], groups[a][i]
            now = _seen(grams, stay, groups)
            if now > best:
                best, improved = now, True
            else:
                groups[a][i], groups[b][j] = groups[b][j], groups[a][i]
    return [(*stay, *sorted(group)) for group in groups]


def _seen(grams: Array, stay: Sequence[int], groups: Sequence[Sequence[int]]) -> tuple[float, ...]:
    """How well each set-up sees its faintest mode, worst first, to ten digits so that rounding decides nothing."""
    G = np.stack([grams[[*stay, *group]].sum(axis=0) for group in groups])
    return tuple(float(f"{x:.10g}") for x in np.sort(CRITERIA["visibility"].score(G)))
