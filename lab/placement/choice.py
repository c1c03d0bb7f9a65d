"""Choice: the best blocks of channels, proven by enumeration up to a limit, else with a bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.placement.criteria import Criterion
from lab.placement.search import ceiling, count, enumerated, exchange, greedy

LIMIT = 200_000
"""Layouts up to this number are all compared, which proves the best."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Blocks chosen, and what is known about the choice.

    Attributes:
        chosen: positions of blocks, in rising order.
        score: of the criterion.
        ceiling: score that no choice exceeds.
        proven: whether every choice was compared.
        layouts, scores: of every choice, best first, where all were compared; no rows otherwise.
    """

    chosen: tuple[int, ...]
    score: float
    ceiling: float
    proven: bool
    layouts: np.ndarray
    scores: Array


def choose(
    grams: Array,
    n: int,
    criterion: Criterion,
    *,
    fixed: Sequence[int] = (),
    limit: int = LIMIT,
    work: Work = UNHEARD,
) -> Choice:
    """The n blocks of highest score: proven by enumeration up to a limit, else found by exchange with a bound.

    Args:
        grams: what each block brings, shape (n_blocks, m, m).
        n: blocks to choose, the fixed ones included.
        criterion: score.
        fixed: blocks in every choice.
        limit: number of choices up to which all are compared.
        work: told of every few thousand choices, or every step towards the bound.
    """
    if count(len(grams), n, n_fixed=len(fixed)) <= limit:
        layouts, scores = enumerated(grams, n, criterion, fixed=fixed, work=work)
        order = np.argsort(-scores, kind="stable")
        layouts, scores = layouts[order], scores[order]
        best = tuple(int(block) for block in layouts[0])
        return Choice(best, float(scores[0]), float(scores[0]), True, layouts, scores)
    best = exchange(grams, greedy(grams, n, criterion, fixed=fixed), criterion, fixed=fixed)
    score = float(criterion.score(grams[list(best)].sum(axis=0)[None])[0])
    top = ceiling(grams, best, criterion, fixed=fixed, work=work)
    return Choice(best, score, top, False, np.zeros((0, n), dtype=int), np.zeros(0))
