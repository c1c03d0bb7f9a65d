"""How much evidence chance alone may reach, against laws of large numbers known in closed form."""

import numpy as np
import pytest

from lab.diagnosis.chance import DRAWS, LEVEL, NO_CHANCE, Chance, quantile

N_OUTPUTS, N = 2, 2000
N_TOTAL = 5000


@pytest.fixture(scope="module")
def chance():
    return Chance((N_OUTPUTS, N), N_TOTAL)


def test_gain_is_what_a_regression_explains(chance):
    slopes = np.random.default_rng(1).standard_normal((3, N_OUTPUTS, N))
    A, nu = slopes.reshape(3, -1).T, chance.noise[0].ravel()
    left = nu - A @ np.linalg.lstsq(A, nu, rcond=None)[0]
    expected = nu @ nu - left @ left - 3 * np.log(N_TOTAL)
    # A difference of sums of 4000 squares.
    assert chance.gains(slopes)[0] == pytest.approx(expected, abs=1e-9)


def test_causes_that_act_alike_are_one_look(chance):
    slopes = np.random.default_rng(2).standard_normal((2, N_OUTPUTS, N))
    mixed = np.tensordot([[2.0, 1.0], [0.3, -4.0]], slopes, axes=1)
    np.testing.assert_allclose(chance.gains(mixed), chance.gains(slopes), atol=1e-8)


def test_a_cause_that_does_nothing_gains_nothing(chance):
    assert np.all(chance.gains(np.zeros((1, N_OUTPUTS, N))) == -np.log(N_TOTAL))


def test_tones(chance):
    # The largest of m squares with mean 2 lies at 2 (log m + γ) on average, and scatters by 2 π / √6.
    m = N_OUTPUTS * (N // 2 - 1)
    mean = 2 * (np.log(m) + np.euler_gamma) - 3 * np.log(N_TOTAL)
    # Four standard errors of the mean of so few draws.
    assert np.mean(chance.tones) == pytest.approx(mean, abs=4 * 2.565 / np.sqrt(DRAWS))


def test_quantile_of_many_independent_looks():
    # The largest of 200 χ²₂ falls short of a level with probability (1 - exp(-x/2))^200, whatever the fit by moments does.
    found = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        found.append(quantile(rng.chisquare(2, (DRAWS, 200)).max(axis=1), 0))
    exact = -2 * np.log(-np.expm1(np.log1p(-LEVEL) / 200))
    # χ² with few degrees of freedom has Gumbel's tail with scale 2; moments of 32 draws scatter the quantile by 2.1.
    assert np.mean(found) == pytest.approx(exact, abs=4 * 2.1 / np.sqrt(40))


def test_an_outlier_among_the_parameters():
    # Among n normal numbers beside one that is known to be right, the gain from setting the farthest free.
    n, rng = 12, np.random.default_rng(3)
    z = rng.standard_normal((200_000, n + 1))
    squares = np.sum(z**2, axis=1)
    gains = (n + 1) * np.log(squares / (squares - np.max(z[:, :n] ** 2, axis=1)))
    threshold = quantile(np.full(DRAWS, -50.0), n)
    # 200 of 200 000 are expected at most: Bonferroni errs on the safe side, here by little.
    assert 140 < np.sum(gains > threshold) < 200 + 4 * np.sqrt(200)


def test_never_below_even_odds():
    assert quantile(np.full(DRAWS, -50.0), 0) == 0.0
    assert quantile(NO_CHANCE, 0) == 0.0
