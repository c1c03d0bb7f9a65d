"""Whether a residual is noise, and whether a cause explains it or only patches it."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal

from lab.diagnosis.whiteness import MATTERS, Whiteness, patches, whiteness

N = 4000


def noise(seed, rows=3):
    return np.random.default_rng(seed).standard_normal((rows, N))


def test_noise_passes():
    # One seed in a thousand would fail.
    assert all(whiteness(noise(seed), noise(100 + seed, 2)).white for seed in range(5))


def test_share_is_what_the_past_foretells():
    e = noise(0)
    a = 0.6
    e[1] = scipy.signal.lfilter([1], [1, -a], e[1])
    found = whiteness(e, noise(1, 1))
    assert (found.channel, found.lag, found.white) == (1, 1, False)
    # An autoregression of order one foretells a² of its power; a share scatters by 2 a √((1 - a²) / n), 0.015 here.
    assert found.share == pytest.approx(a**2, abs=4 * 0.015)
    assert found.left == pytest.approx(-np.log1p(-(a**2)), abs=0.15)


def test_what_an_input_explains_is_found():
    e, u = noise(2), noise(3, 2)
    e[2, 5:] += 0.5 * u[1, :-5]
    found = whiteness(e, u)
    assert (found.channel, found.lag, found.with_input) == (2, 5, 1)


def test_little_is_passed_over():
    small = Whiteness(9.0, 4.8, 0, 1, None, 0.5 * MATTERS, 0.03)
    assert small.passed
    assert not small.white
    assert not replace(small, share=2 * MATTERS).passed


@pytest.mark.parametrize(
    ("before", "after", "patched"),
    [
        ((50.0, 0.76), (49.0, 0.75), True),  # hardly anything taken
        ((50.0, 0.76), (20.0, 0.20), False),  # most of it
        ((50.0, 0.76), (4.0, 0.01), False),  # all of it
        ((8.0, 0.034), (5.5, 0.022), True),  # little was left, and most of that still is
        (
            (4.0, 0.01),
            (4.1, 0.01),
            False,
        ),  # nothing was left: a parameter out of tolerance, which residuals do not show
    ],
)
def test_patches(before, after, patched):
    def told(largest, share):
        return Whiteness(largest, 4.8, 0, 1, None, share, -np.log1p(-share))

    assert patches(told(*before), told(*after)) is patched
