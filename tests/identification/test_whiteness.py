"""White residuals pass, coloured ones do not."""

import numpy as np
import scipy.stats

from identification.whiteness import autocorrelation, whiteness


def test_autocorrelation_is_the_plain_sum():
    x = np.random.default_rng(0).standard_normal((2, 50))
    plain = [[np.sum(row[k:] * row[:-k]) / np.sum(row**2) for k in range(1, 8)] for row in x]
    np.testing.assert_allclose(autocorrelation(x, 7), plain, atol=1e-14)


def test_probabilities_of_white_noise_are_uniform():
    rng = np.random.default_rng(1)
    p = np.concatenate(
        [whiteness([rng.standard_normal((4, 2000)), rng.standard_normal((4, 500))]) for _ in range(100)]
    )
    # 400 values: a uniform sample fails the test of Kolmogorov at 0.1 % once in a thousand seeds.
    assert scipy.stats.kstest(p, "uniform").pvalue > 1e-3


def test_coloured_noise_is_found_out():
    e = np.random.default_rng(2).standard_normal((2, 2001))
    e[1, 1:] += (
        0.3 * e[1, :-1].copy()
    )  # correlation 0.28 at lag one: twelve standard deviations of 2000 samples
    p = whiteness([e])
    assert p[0] > 1e-3
    assert p[1] < 1e-12


def test_gaps_leave_the_probabilities_uniform():
    rng = np.random.default_rng(3)
    p = []
    for _ in range(100):
        e = rng.standard_normal((4, 2000))
        e[:2, 500:1300] = np.nan  # a stretch
        e[2:, ::3] = np.nan  # every third sample, which leaves a third of the pairs or all that are left
        p.append(whiteness([e]))
    for rows in (np.ravel([x[:2] for x in p]), np.ravel([x[2:] for x in p])):
        # 200 values: as above.
        assert scipy.stats.kstest(rows, "uniform").pvalue > 1e-3


def test_nothing_left_is_white():
    assert whiteness([np.zeros((1, 100))])[0] == 1
    assert whiteness([np.ones((1, 3))])[0] == 1  # too short to say anything
