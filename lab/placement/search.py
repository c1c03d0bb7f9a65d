"""Search: layouts of highest score by greedy choice, by exchange and by enumeration, and what none can exceed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, islice

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.placement.criteria import Criterion

SHORTLIST = 64
"""Exchanges tried in full: those that promise most by the slope of the score."""
RIDGE = 1e-6
"""Information added while a layout is not complete, as a share of that of all candidates."""
CHUNK = 4096
GAIN = 1e-10
"""An exchange that gains less, relative to the score, is rounding."""


def greedy(grams: Array, n: int, criterion: Criterion, *, fixed: Sequence[int] = ()) -> tuple[int, ...]:
    """Blocks chosen one by one, each where the score gains most.

    Args:
        grams: what each block brings, shape (n_blocks, m, m).
        n: blocks to choose, the fixed ones included.
        criterion: score.
        fixed: blocks chosen already.

    Returns:
        The n blocks in rising order.
    """
    ridge = RIDGE * np.trace(grams.sum(axis=0)) / grams.shape[1] * np.eye(grams.shape[1])
    chosen = list(fixed)
    G = grams[chosen].sum(axis=0) + ridge
    while len(chosen) < n:
        rest = np.setdiff1d(np.arange(len(grams)), chosen)
        scores = np.concatenate([criterion.score(G + grams[part]) for part in _parts(rest)])
        best = int(rest[np.argmax(scores)])
        chosen.append(best)
        G = G + grams[best]
    return tuple(sorted(chosen))


def exchange(
    grams: Array, start: Sequence[int], criterion: Criterion, *, fixed: Sequence[int] = ()
) -> tuple[int, ...]:
    """Blocks after exchanges of one for another, until none of those tried gains.

    Args:
        grams: what each block brings, shape (n_blocks, m, m).
        start: blocks to begin with.
        criterion: score.
        fixed: blocks that stay.

    Returns:
        As many blocks as at the start, in rising order.

    Source: Fedorov (1972), Theory of Optimal Experiments, section 3.2.
    """
    chosen = sorted(start)
    score = float(criterion.score(grams[chosen].sum(axis=0)[None])[0])
    improved = True
    while improved:
        improved = False
        for old in [block for block in chosen if block not in fixed]:
            G = grams[[block for block in chosen if block != old]].sum(axis=0)
            rest = _shortlist(grams, np.setdiff1d(np.arange(len(grams)), chosen), G, criterion)
            if not rest.size:
                continue
            scores = np.concatenate([criterion.score(G + grams[part]) for part in _parts(rest)])
            best = int(np.argmax(scores))
            if scores[best] > score + GAIN * max(abs(score), 1e-300) or (
                np.isinf(score) and scores[best] > score
            ):
                chosen = sorted([*(block for block in chosen if block != old), int(rest[best])])
                score, improved = float(scores[best]), True
    return tuple(chosen)


def count(n_blocks: int, n: int, *, n_fixed: int = 0) -> int:
    """Number of layouts of n blocks that contain the fixed ones."""
    return math.comb(n_blocks - n_fixed, n - n_fixed)


def enumerated(
    grams: Array, n: int, criterion: Criterion, *, fixed: Sequence[int] = (), work: Work = UNHEARD
) -> tuple[np.ndarray, Array]:
    """Every layout with its score, in no order.

    Args:
        grams: what each block brings, shape (n_blocks, m, m).
        n: blocks to choose, the fixed ones included.
        criterion: score.
        fixed: blocks in every layout.
        work: told of every few thousand layouts.

    Returns:
        Layouts, shape (n_layouts, n), each in rising order, and scores, shape (n_layouts,).
    """
    free = [block for block in range(len(grams)) if block not in fixed]
    base = grams[list(fixed)].sum(axis=0)
    layouts, scores = [], []
    n_chunks = math.ceil(math.comb(len(free), n - len(fixed)) / CHUNK)
    for rows in work.each(_chunks(combinations(free, n - len(fixed))), n_chunks):
        picked = np.array(rows, dtype=int).reshape(len(rows), n - len(fixed))
        G = np.broadcast_to(base, (len(rows), *base.shape)).copy()
        for column in picked.T:
            G += grams[column]
        held = np.broadcast_to(np.array(fixed, dtype=int), (len(rows), len(fixed)))
        layouts.append(np.sort(np.concatenate([held, picked], axis=1), axis=1))
        scores.append(criterion.score(G))
    return np.concatenate(layouts), np.concatenate(scores)


def ceiling(
    grams: Array,
    start: Sequence[int],
    criterion: Criterion,
    *,
    fixed: Sequence[int] = (),
    iterations: int = 300,
    work: Work = UNHEARD,
) -> float:
    """A score that no layout of as many blocks exceeds; the top of the criterion where its slope gives no lower one.

    Blocks may be chosen in part: the score is concave, so its tangent at any such choice lies above all layouts, and
    the choice is moved (by Frank and Wolfe) until the tangent lies low.

    Args:
        grams: what each block brings, shape (n_blocks, m, m).
        start: a good layout.
        criterion: score.
        fixed: blocks in every layout.
        iterations: steps.
        work: told of every step.

    Source: Boyd and Vandenberghe (2004), Convex Optimization, sections 3.1.3 and 7.5.2; Joshi and Boyd (2009), IEEE
    Trans. Signal Process. 57(2), 451-462, for the relaxation.
    """
    if criterion.slope is None:
        return criterion.top
    n, flat = len(start), grams.reshape(len(grams), -1)
    free = np.setdiff1d(np.arange(len(grams)), list(fixed))
    G = grams[list(start)].sum(axis=0)
    if not np.isfinite(criterion.score(G[None])[0]):
        G = grams.sum(axis=0) * (n / len(grams))
    slope, lowest = criterion.slope(G), np.inf
    for k in work.each(range(iterations)):
        here = criterion.slope(G)
        # Of many tangents at a kink, an average over the way lies lowest.
        slope = here if criterion.smooth else slope + (here - slope) * (2 / (k + 2))
        brings = flat @ slope.ravel()
        best = free[np.argsort(-brings[free], kind="stable")[: n - len(fixed)]]
        top = [*fixed, *best]
        tangent = float(np.sum(brings[top]))
        if criterion.smooth:
            tangent += float(criterion.score(G[None])[0]) - float(np.sum(slope * G))
        lowest = min(lowest, tangent)
        G = G + _step(G, grams[top].sum(axis=0) - G, criterion, k)
    return float(lowest)


def _step(G: Array, direction: Array, criterion: Criterion, k: int) -> Array:
    """The move along a direction: the best of a few lengths where the score is smooth."""
    if not criterion.smooth:
        return direction * (2 / (k + 3))
    lengths = np.concatenate([np.geomspace(1e-4, 0.9, 12), [2 / (k + 3)]])
    scores = criterion.score(G + lengths[:, None, None] * direction)
    return np.asarray(lengths[int(np.argmax(scores))] * direction)


def _shortlist(grams: Array, rest: np.ndarray, G: Array, criterion: Criterion) -> np.ndarray:
    """The blocks worth trying beside G: all where they are few or the score has no slope."""
    if rest.size <= SHORTLIST or criterion.slope is None:
        return rest
    m = G.shape[0]
    slope = criterion.slope(G + RIDGE * np.trace(G) / m * np.eye(m))
    brings = grams[rest].reshape(rest.size, -1) @ slope.ravel()
    return np.asarray(rest[np.argsort(-brings, kind="stable")[:SHORTLIST]])


def _parts(rows: np.ndarray) -> Iterator[np.ndarray]:
    for start in range(0, len(rows), CHUNK):
        yield rows[start : start + CHUNK]


def _chunks(rows: Iterator[tuple[int, ...]]) -> Iterator[list[tuple[int, ...]]]:
    while chunk := list(islice(rows, CHUNK)):
        yield chunk
