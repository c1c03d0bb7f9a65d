"""Pairs of states: their turns are the transition, and where they are not told apart nothing is claimed."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st

from lab.pairs import pairs_of
from lab.responder import ready
from lab.twin import twin
from tests.lab.effects.reference import DT, nominal


def moved(pairs):
    """The transition that the pairs stand for."""
    half = pairs.turns.shape[1] // 2
    own, other = np.diag(pairs.turns[0]), np.diag(pairs.turns[1])
    return pairs.shapes @ (own + np.roll(other, half, axis=1)) @ pairs.inverse


@given(
    swings=st.lists(st.tuples(st.integers(1, 30), st.floats(0.5, 1.0)), min_size=1, max_size=4),
    decays=st.lists(st.integers(-9, 9), max_size=5),
    seed=st.integers(0, 2**32 - 1),
)
def test_turns_are_the_transition(swings, decays, seed):
    angles = [(0.1 * a, r) for a, r in swings]
    blocks = [r * np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) for a, r in angles]
    inner = scipy.linalg.block_diag(*blocks, *(d / 10 for d in decays))
    mixing = scipy.linalg.qr(np.random.default_rng(seed).standard_normal(inner.shape))[0]
    F = mixing @ inner @ mixing.T
    pairs = pairs_of(F)
    # Equal frequencies are told apart as well as any here, since the matrix is normal; rounding may part them badly, though.
    if len(set(swings)) == len(swings) and len(set(decays)) == len(decays):
        assert pairs is not None
    if pairs is not None:
        # The condition that is let through is 1e5, of rounding 1e-16.
        np.testing.assert_allclose(moved(pairs), F, rtol=0, atol=1e-10)


def test_a_structure_comes_apart_whatever_its_units():
    F = ready(twin(nominal()).plant, DT).matrices[0]
    units = np.array([1e-6, 1e-3, 1.0, 1e3, 1.0, 1e6])
    for G in (F, F * units / units[:, None]):
        pairs = pairs_of(G)
        assert pairs is not None
        assert np.all(np.abs(moved(pairs) - G) <= 1e-12 * np.abs(pairs.shapes) @ np.abs(pairs.inverse))


@pytest.mark.parametrize("F", [np.array([[1.0, 0.01], [0.0, 1.0]]), np.full((2, 2), np.nan)])
def test_a_rigid_body_has_no_pairs(F):
    assert pairs_of(F) is None
