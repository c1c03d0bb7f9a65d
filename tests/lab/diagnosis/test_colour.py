"""Colour: samples that count as one."""

import numpy as np
import pytest
import scipy.signal

from lab.diagnosis.colour import colour


def test_white_noise_has_no_colour():
    e = np.random.default_rng(1).standard_normal((2, 4000))
    # Five squared correlations of 1/n each are nothing beside one.
    assert 1 <= colour(e) < 1.05


@pytest.mark.parametrize("a", [0.5, 0.9])
def test_first_order_noise_has_the_colour_of_its_correlations(a):
    # ρ_k = a^|k|, so that Σ ρ_k² = (1 + a²) / (1 - a²).
    e = scipy.signal.lfilter([1], [1, -a], np.random.default_rng(2).standard_normal((1, 200_000)))
    # Few correlations matter, each known to about 1/√200 000: a tenth is many times their scatter.
    assert colour(e) == pytest.approx(
        (1 + a**2) / (1 - a**2), rel=0.15
    )  # scatter of the sum over n/2 lags, 0.7


def test_a_lasting_tone_counts_as_few_samples():
    e = np.sin(0.3 * np.arange(2000))[None]
    assert colour(e) > 300


def test_means_have_the_scatter_that_colour_says():
    """The correlation of two independent signals of one colour scatters by √(colour / n)."""
    rng, n, a = np.random.default_rng(3), 2000, 0.8
    x = scipy.signal.lfilter([1], [1, -a], rng.standard_normal((2, 400, n)))[:, :, 100:]
    r = np.sum(x[0] * x[1], axis=1) / np.sqrt(np.sum(x[0] ** 2, axis=1) * np.sum(x[1] ** 2, axis=1))
    found = np.var(r) * r.size / (r.size - 1) * x.shape[2]
    # A variance over 400 pairs is known to √(2/400) = 7 %; four of these.
    assert found == pytest.approx((1 + a**2) / (1 - a**2), rel=0.28)
