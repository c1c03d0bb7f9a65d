"""Axes and colours for drawing."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lab.show.drawing import Axes, diverging, rgb, sequential, ticks


@given(low=st.floats(-1e6, 1e6), span=st.floats(1e-3, 1e7), n=st.integers(3, 12))
def test_ticks_are_round_few_and_inside(low, span, n):
    values = ticks(low, low + span, n)
    assert len(values) <= n + 1
    assert all(low - 1e-6 * span <= v <= low + span * (1 + 1e-6) for v in values)
    if len(values) > 1:
        step = values[1] - values[0]
        leading = step / 10 ** np.floor(np.log10(step * (1 + 1e-9)))
        assert min(abs(leading - digit) for digit in (1, 2, 5)) < 1e-3


def test_known_ticks():
    assert ticks(0.0, 10.0, 5) == [0, 2, 4, 6, 8, 10]
    assert ticks(-1.1, 1.1, 5) == [-1.0, -0.5, 0.0, 0.5, 1.0]


def test_axes_put_values_where_they_belong():
    axes = Axes((0.0, 10.0), (-1.0, 1.0), width=100.0, height=50.0)
    np.testing.assert_allclose(axes.at([0, 10, 5], [-1, 1, 0]), [[0, 50], [100, 0], [50, 25]])
    points, texts = axes.tick_labels()
    assert len(points) == len(texts)
    assert "-0.5" in texts


def test_colours_are_symmetric_and_monotonous_in_brightness():
    values = np.linspace(-1, 1, 21)
    colors = diverging(values, 1.0).astype(int)
    brightness = colors.sum(axis=1)
    assert np.all(np.diff(brightness[:11]) > 0)  # black and white print keeps the size
    assert np.all(np.diff(brightness[10:]) < 0)
    assert colors[0, 2] > colors[0, 0]  # negative is blue
    assert colors[-1, 0] > colors[-1, 2]  # positive is red
    assert np.all(np.diff(sequential(np.linspace(0, 1, 11)).astype(int).sum(axis=1)) < 0)


def test_zero_range_and_missing_values_have_the_colour_of_zero():
    np.testing.assert_array_equal(diverging(np.array([0.0, np.nan]), 0.0), [[240] * 3] * 2)


def test_hexadecimal_colour():
    assert rgb("#0072B2") == (0, 114, 178)
