"""Criteria: slopes are derivatives, scores are concave, and MAC is what it is by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab.placement.criteria import CRITERIA

CONCAVE = [name for name, criterion in CRITERIA.items() if criterion.slope is not None]


def information(seed, m=4):
    rows = np.random.default_rng(seed).standard_normal((3 * m, m))
    return rows.T @ rows


@pytest.mark.parametrize("name", CONCAVE)
@given(seed=st.integers(0, 10_000))
def test_no_score_rises_above_its_tangent(name, seed):
    rule, G, H = CRITERIA[name], information(seed), information(seed + 1)
    here, there = rule.score(np.stack([G, H]))
    tangent = here + np.sum(rule.slope(G) * (H - G))
    assert there <= tangent + 1e-9 * (abs(tangent) + abs(there) + 1)  # rounding of sums of tens of terms


@pytest.mark.parametrize("name", CONCAVE)
def test_slope_is_the_derivative(name):
    rule, G = CRITERIA[name], information(3)
    # Random matrices have no equal eigenvalues or diagonals, where the slope of "e" and "visibility" would jump.
    step = 1e-6 * information(4)
    up, down = rule.score(np.stack([G + step, G - step]))
    # Central differences: truncation of 1e-12 and rounding of 1e-16 over 1e-6, both relative.
    assert (up - down) / 2 == pytest.approx(float(np.sum(rule.slope(G) * step)), rel=1e-5)


def test_figures_of_a_diagonal_information():
    G = np.diag([4.0, 1.0])[None]
    figures = {name: float(rule.figure(rule.score(G))[0]) for name, rule in CRITERIA.items()}
    # Standard deviations 1/2 and 1.
    assert figures["d"] == pytest.approx(np.sqrt(0.5))
    assert figures["a"] == pytest.approx(np.sqrt((0.25 + 1) / 2))
    assert figures["e"] == pytest.approx(1.0)
    assert figures["mac"] == 0.0
    assert figures["visibility"] == pytest.approx(1.0)


def test_mac_between_two_shapes_by_hand():
    Phi = np.array([[1.0, 1.0], [1.0, 0.0]])
    # (1·1 + 1·0)² / (2 · 1)
    assert CRITERIA["mac"].score((Phi.T @ Phi)[None])[0] == pytest.approx(-0.5)


def test_a_mode_that_no_sensor_sees_is_told_from_none():
    assert CRITERIA["mac"].score(np.diag([1.0, 0.0])[None])[0] == -1.0
    assert CRITERIA["a"].score(np.diag([1.0, 0.0])[None])[0] == -np.inf
    assert CRITERIA["d"].score(np.diag([1.0, 0.0])[None])[0] == -np.inf
