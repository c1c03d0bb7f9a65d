"""Effective independence: against its formula evaluated naively, and what must not change it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.errors import LabError
from lab.placement.independence import effective_independence, kinetic_energy


def naive(Phi, n):
    """Kammer's deletion, with the projector written out."""
    left = list(range(len(Phi)))
    while len(left) > n:
        P = Phi[left]
        share = np.diag(P @ np.linalg.inv(P.T @ P) @ P.T)
        del left[int(np.argmin(share))]
    return tuple(left)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_channels_one_by_one_as_by_the_formula(seed):
    # Random shapes have no ties, so that rounding decides nothing.
    Phi = np.random.default_rng(seed).standard_normal((15, 3))
    assert effective_independence(Phi[:, None], 5) == naive(Phi, 5)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_scaling_and_mixing_modes_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    Phi = rng.standard_normal((12, 3, 4))
    mixed = Phi @ (rng.standard_normal((4, 4)) + 4 * np.eye(4))
    assert effective_independence(Phi, 4) == effective_independence(mixed, 4)


def test_a_block_with_one_channel_counts_like_that_channel():
    Phi = np.random.default_rng(7).standard_normal((10, 1, 3))
    padded = np.concatenate([Phi, np.zeros((10, 2, 3))], axis=1)
    assert effective_independence(padded, 4) == effective_independence(Phi, 4)


def test_blocks_keep_the_largest_determinant_that_one_deletion_can():
    Phi = np.random.default_rng(8).standard_normal((6, 3, 4))
    kept = effective_independence(Phi, 5)

    def det(blocks):
        rows = Phi[list(blocks)].reshape(-1, 4)
        return np.linalg.det(rows.T @ rows)

    assert det(kept) == max(det([i for i in range(6) if i != gone]) for gone in range(6))


def test_fixed_blocks_stay():
    Phi = np.random.default_rng(9).standard_normal((10, 1, 3))
    Phi[4] = 0.0
    assert 4 in effective_independence(Phi, 4, fixed=(4,))
    assert 4 not in effective_independence(Phi, 4)


def test_too_few_channels_are_refused():
    with pytest.raises(LabError, match="2 sensors of 5 candidates cannot tell 3 modes apart"):
        effective_independence(np.random.default_rng(1).standard_normal((5, 1, 3)), 2)


def test_kinetic_energy_by_hand():
    # Masses 1 and 9; shapes of unit modal mass: energies 0.5² · 1 and (√0.75 / 3)² · 9.
    Phi = np.array([[[0.5]], [[np.sqrt(0.75) / 3]]])
    assert kinetic_energy(Phi, Phi * np.array([1.0, 9.0])[:, None, None], 1) == (1,)
