"""Evidence: how far two fits that both err can be told apart."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal

from lab.diagnosis.evidence import ratio_spread
from lab.diagnosis.fit import Fit

A, N, REPEATS = 0.8, 4000, 200
COLOUR = (1 + A**2) / (1 - A**2)
"""Of first-order noise with correlations A^|k|: the sum of their squares."""


def fit_with(residual):
    nothing = np.zeros(0)
    square = np.zeros((0, 0))
    return Fit(nothing, (), residual, 0.0, square, square, square, 0)


def pairs(seed, common):
    """Residuals of two fits, (REPEATS, 2 channels, N) each, of errors that stay alike and are partly the same."""
    e = np.random.default_rng(seed).standard_normal((3, REPEATS, 2, N + 100))
    e = scipy.signal.lfilter([1], [1, -A], e)[..., 100:]
    return e[0] + common * e[2], e[1] + common * e[2]


def ratio(told, other):
    """Log likelihood ratio of two residuals, samples that count as one taken as one."""
    power = np.mean(other**2, axis=-1) / np.mean(told**2, axis=-1)
    return 0.5 * N / COLOUR * np.sum(np.log(power), axis=-1)


@pytest.mark.parametrize("common", [0.0, 3.0])
def test_the_spread_is_the_scatter_of_the_ratio_over_repeated_tests(common):
    told, other = pairs(1, common)
    spreads = [ratio_spread(fit_with(a), fit_with(b), COLOUR) for a, b in zip(told, other, strict=True)]
    # A scatter over 200 repeats is known to 1/√400 = 5 %; stretches of correlated samples miss a few per cent at their ends.
    assert np.mean(spreads) == pytest.approx(np.std(ratio(told, other)), rel=0.2)


def test_a_cause_that_is_better_all_along_is_told_with_certainty():
    (told, *_), _ = pairs(2, 0.0)
    found = fit_with(told)
    worse = replace(found, residual=1.5 * told)
    assert ratio(told, 1.5 * told) > 10 * ratio_spread(found, worse, COLOUR)
