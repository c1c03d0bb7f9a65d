"""What is said of error bars, and what noise shifts."""

import numpy as np
import pytest

from benchmarks.error_bars import pulses
from identification.found_bars import told_shift
from identification.identify import identify
from identification.residual_scatter import scatter_of
from identification.spectral_scatter import ModeErrorBars
from tests.systems import paper_chain3

MODES = paper_chain3().modes()


def test_a_shift_is_part_of_the_deviation_where_the_truth_is_known():
    values = np.random.default_rng(0).standard_normal((50_000, 2)) * [1.0, 2.0] + 3.0
    std, shift = scatter_of(values, np.array([2.0, np.nan]))
    # √(1² + 1²) about the truth, 2 about the mean; 50 000 draws tell them to 1 / √(10⁵) = 0.3 %: four of it.
    np.testing.assert_allclose(std, [np.sqrt(2), 2.0], rtol=0.013)
    assert shift[0] == pytest.approx(1.0, abs=4 / np.sqrt(50_000))
    assert np.isnan(shift[1])


def test_estimates_that_are_often_lost_have_neither():
    values = np.zeros((20, 1))
    values[:3] = np.nan
    std, shift = scatter_of(values, np.zeros(1))
    assert np.isinf(std[0])
    assert np.isnan(shift[0])


def test_only_a_shift_to_speak_of_is_told_and_of_the_mode_that_has_most():
    none = np.full(3, np.nan)
    size = np.full(3, 1e-3)
    assert told_shift(MODES, ModeErrorBars(size, size, none)) == ()
    assert told_shift(MODES, ModeErrorBars(size, size, 0.4 * size)) == ()
    (said,) = told_shift(MODES, ModeErrorBars(size, size, np.array([0.6, -0.9, np.nan]) * size))
    assert f"{MODES.frequency_hz[1]:.4g} Hz by about -0.0009" in said
    assert told_shift(MODES.take([]), ModeErrorBars(none[:0], none[:0], none[:0])) == ()


def test_an_observer_of_short_pulses_tells_what_noise_shifts():
    short = pulses(np.random.default_rng(0)).cut(0, 10.0)
    found = identify(short, "okid_era", order=6)
    # 5 % of noise on less than one decay: an observer of hundreds of coefficients sees too much damping.
    assert "Noise shifts the damping ratios" in found.explanation
