"""Search: a small case by hand, enumeration against brute force, and bounds that hold."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.placement.choice import choose
from lab.placement.criteria import CRITERIA
from lab.placement.search import ceiling, count, enumerated, exchange, greedy


def blocks_of(seed, n=9, m=3, k=1):
    rows = np.random.default_rng(seed).standard_normal((n, k, m))
    return np.einsum("bcm,bcn->bmn", rows, rows)


def test_by_hand():
    # Two modes, three sensors at 0°, 90° and 45°: the two at right angles have det G = 1, the others 1/2.
    rows = np.array([[1.0, 0.0], [0.0, 1.0], [np.sqrt(0.5), np.sqrt(0.5)]])
    grams = np.einsum("bm,bn->bmn", rows, rows)
    found = choose(grams, 2, CRITERIA["d"])
    assert found.chosen == (0, 1)
    assert found.proven
    np.testing.assert_allclose(np.exp(2 * found.scores), [1.0, 0.5, 0.5])
    assert choose(grams, 2, CRITERIA["d"], fixed=(2,)).chosen in ((0, 2), (1, 2))
    assert choose(grams, 2, CRITERIA["mac"]).chosen == (0, 1)


@pytest.mark.parametrize("name", CRITERIA)
def test_enumeration_is_complete_and_right(name):
    grams, rule = blocks_of(1, k=2), CRITERIA[name]
    layouts, scores = enumerated(grams, 4, rule, fixed=(5,))
    by_hand = {
        tuple(sorted((5, *rest))): rule.score(sum(grams[i] for i in (5, *rest))[None])[0]
        for rest in combinations([0, 1, 2, 3, 4, 6, 7, 8], 3)
    }
    assert len(layouts) == len(by_hand) == count(9, 4, n_fixed=1)
    for layout, score in zip(layouts, scores, strict=True):
        # Sums in another order: rounding alone, which the inverse of an ill-conditioned G enlarges.
        assert score == pytest.approx(by_hand[tuple(layout)], rel=1e-8)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), name=st.sampled_from(sorted(CRITERIA)))
def test_search_never_beats_enumeration_and_the_ceiling_is_above_both(seed, name):
    grams, rule = blocks_of(seed), CRITERIA[name]
    best = float(np.max(enumerated(grams, 4, rule)[1]))
    chosen = exchange(grams, greedy(grams, 4, rule), rule)
    score = float(rule.score(grams[list(chosen)].sum(axis=0)[None])[0])
    slack = 1e-9 * (abs(best) + 1)  # rounding
    assert len(set(chosen)) == 4
    assert score <= best + slack
    top = ceiling(grams, chosen, rule)
    assert top >= best - slack
    assert np.isfinite(top)


def test_exchange_leaves_no_better_neighbour():
    grams, rule = blocks_of(5, n=14, m=4), CRITERIA["d"]
    chosen = exchange(grams, range(6), rule, fixed=(2,))
    score = rule.score(grams[list(chosen)].sum(axis=0)[None])[0]
    assert 2 in chosen
    for old in set(chosen) - {2}:
        for new in set(range(14)) - set(chosen):
            near = [*(set(chosen) - {old}), new]
            assert rule.score(grams[near].sum(axis=0)[None])[0] <= score + 1e-9


def test_the_ceiling_is_reached_where_blocks_can_be_split_evenly():
    # Twice the same two sensors: half of each pair gives the same information as one of each.
    rows = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    grams = np.einsum("bm,bn->bmn", rows, rows)
    for name in ("d", "a", "e", "visibility"):
        rule = CRITERIA[name]
        # Where the score has a kink, the bound is an average over 300 tangents, of which the first were poor.
        tolerance = 1e-9 if rule.smooth else 0.02
        assert ceiling(grams, (0, 2), rule) == pytest.approx(rule.score(np.eye(2)[None])[0], abs=tolerance)
