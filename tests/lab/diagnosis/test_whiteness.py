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


def test_gaps_neither_hide_nor_make_what_is_left():
    missing = np.zeros((3, N), dtype=bool)
    missing[0, 300:3700] = missing[2, :3990] = True
    missing[1] = np.arange(N) % 3 == 0
    # One seed in a thousand would fail.
    for seed in range(5):
        gappy = np.where(missing, 0.0, noise(seed) + 0.3)
        assert whiteness(gappy, noise(100 + seed, 2), missing=missing).white
    e, a = noise(0), 0.6
    e[0] = scipy.signal.lfilter([1], [1, -a], e[0])
    found = whiteness(np.where(missing, 0.0, e), noise(1, 1), missing=missing)
    assert (found.channel, found.lag, found.white) == (0, 1, False)
    # As without gaps, of 600 samples.
    assert found.share == pytest.approx(a**2, abs=4 * 0.04)


def test_noise_beside_signals_passes():
    # One seed in a thousand would fail, whatever the signals.
    signals = np.array([np.sign(noise(7, 1)[0]), 1e-9 * noise(8, 1)[0], np.zeros(N)])
    assert all(whiteness(noise(seed), noise(100 + seed, 2), signals).white for seed in range(5))


@pytest.mark.parametrize(("bend", "power"), [(lambda y: np.clip(y, -1.5, 1.5), 3), (np.abs, 2)])
def test_what_is_left_of_a_bent_signal_is_found(bend, power):
    # Signals without a memory, less the best straight line: past and inputs tell nothing of it.
    e, y = noise(4), noise(5)
    left = bend(y[1])
    left -= np.polyval(np.polyfit(y[1], left, 1), y[1])
    e[1] = 0.1 * e[1] + left
    assert whiteness(e, noise(6, 1)).white
    found = whiteness(e, noise(6, 1), y)
    assert (found.channel, found.of_signal, found.with_input, found.white) == (1, power, None, False)
    # An independent regression on what it correlates with; the share scatters by less than 0.02.
    curve = np.stack([np.ones(N), y[1], y[1] ** 2, y[1] ** 3])
    explained = e[1] - curve.T @ np.linalg.lstsq(curve.T, e[1])[0]
    assert found.share == pytest.approx(1 - np.var(explained) / np.var(e[1]), abs=0.02)


def test_little_is_passed_over():
    small = Whiteness(9.0, 4.8, 0, 1, None, 0.5 * MATTERS, 0.03, 0.0)
    assert small.passed
    assert not small.white
    assert not replace(small, share=2 * MATTERS).passed


@pytest.mark.parametrize(
    ("before", "after", "patched"),
    [
        ((50.0, 0.76, 0.0), (49.0, 0.75, -0.01), True),  # hardly anything taken
        ((50.0, 0.76, 0.0), (20.0, 0.20, -1.2), False),  # most of it
        ((50.0, 0.76, 0.0), (4.0, 0.01, -1.4), False),  # all of it
        ((8.0, 0.034, 0.0), (5.5, 0.022, -0.01), True),  # little was left, and most of that still is
        ((50.0, 0.62, 0.0), (40.0, 0.57, -6.5), False),  # behind all that was known to be left, more shows
        (
            (4.0, 0.01, 0.0),
            (4.1, 0.01, 0.0),
            False,
        ),  # nothing was left: a parameter out of tolerance, which residuals do not show
    ],
)
def test_patches(before, after, patched):
    def told(largest, share, level):
        return Whiteness(largest, 4.8, 0, 1, None, share, -np.log1p(-share), level)

    assert patches(told(*before), told(*after)) is patched


def test_level_is_that_of_the_power():
    e = noise(3)
    twice = whiteness(2 * e, np.zeros((0, e.shape[1])))
    once = whiteness(e, np.zeros((0, e.shape[1])))
    # Three channels of four times the power.
    assert twice.level - once.level == pytest.approx(3 * np.log(4), rel=1e-12)
