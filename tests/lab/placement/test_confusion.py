"""Confusion: the closed form against drawn data, and its limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab.placement.confusion import confusion, lengths_and_cosines, mistaken, without


@pytest.mark.parametrize(("length", "cosine"), [(1.0, 0.0), (2.0, 0.5), (3.0, 0.9), (2.0, -0.7), (0.3, 0.2)])
def test_as_often_as_in_drawn_data(length, cosine):
    n, rng = 200_000, np.random.default_rng(0)
    rival = np.array([cosine, np.sqrt(1 - cosine**2)])
    x = np.array([length, 0.0]) + rng.standard_normal((n, 2))
    wrong = np.mean(np.abs(x @ rival) > np.abs(x[:, 0]))
    expected = float(confusion(np.array(length), np.array(cosine)))
    assert wrong == pytest.approx(
        expected, abs=4 * np.sqrt(expected / n)
    )  # four standard deviations of a count


@given(length=st.floats(0, 50), cosine=st.floats(-1, 1))
def test_never_worse_than_a_coin_and_the_same_for_a_flipped_rival(length, cosine):
    p = float(confusion(np.array(length), np.array(cosine)))
    assert 0 <= p <= 0.5 + 1e-15
    assert p == pytest.approx(float(confusion(np.array(length), np.array(-cosine))), abs=1e-15)


def test_a_parallel_rival_and_an_invisible_cause_are_coins():
    assert confusion(np.array(5.0), np.array(1.0)) == 0.5
    assert confusion(np.array(0.0), np.array(0.3)) == 0.5


@pytest.mark.parametrize(("length", "cosine"), [(1.0, 0.0), (2.0, 0.5), (3.0, -0.9)])
def test_of_one_rival_drawn_data_and_the_closed_form_agree(length, cosine):
    n = 40_000
    found = mistaken(
        np.full(2, length), np.array([[1.0, cosine], [cosine, 1.0]]), np.eye(2, dtype=bool), n_draws=n
    )
    expected = float(confusion(np.array(length), np.array(cosine)))
    # Four standard deviations of a count.
    np.testing.assert_allclose(found, expected, atol=4 * np.sqrt(expected / n))


def test_rivals_add_up_and_what_is_alike_counts_as_right():
    length, right = np.full(4, 2.0), np.eye(4, dtype=bool)
    alone = mistaken(length[:2], np.eye(2), right[:2, :2])
    assert np.all(mistaken(length, np.eye(4), right) > alone[0])
    assert not np.any(mistaken(length, np.ones((4, 4)), np.ones((4, 4), dtype=bool)))


def test_parameters_with_a_prior_are_noise_of_their_own():
    rng = np.random.default_rng(2)
    J, D = rng.standard_normal((20, 3)), rng.standard_normal((20, 4))
    noise, precision = np.diag(rng.uniform(0.5, 2, 20)), np.diag([1.0, 4.0, 1e-6])
    columns = np.hstack([J, D])
    products = columns.T @ np.linalg.inv(noise) @ columns
    dense = np.linalg.inv(noise + J @ np.linalg.inv(precision) @ J.T)
    # The loose prior makes the dense matrix ill-conditioned, at about 1e7.
    np.testing.assert_allclose(without(products, 3, precision), D.T @ dense @ D, rtol=0, atol=1e-7)


def test_lengths_and_cosines_by_hand():
    length, cosine = lengths_and_cosines(np.array([[4.0, 1.0], [1.0, 1.0]]))
    np.testing.assert_allclose(length, [2.0, 1.0])
    np.testing.assert_allclose(cosine, [[1.0, 0.5], [0.5, 1.0]])
