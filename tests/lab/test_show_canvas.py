"""Canvas: axes that share what they can."""

import numpy as np
from matplotlib.figure import Figure

from lab.show.figures.canvas import logarithmic, stacked


def test_stacked_figures_show_their_common_axis_at_the_foot():
    frames = stacked(Figure(), 3, 2)
    assert frames.shape == (3, 2)
    assert [[axes.xaxis.get_visible() for axes in row] for row in frames] == [[False] * 2] * 2 + [[True] * 2]
    frames[2, 0].set_xlim(3.0, 4.0)
    assert [axes.get_xlim() for axes in frames[:, 0]] == [(3.0, 4.0)] * 3
    assert frames[0, 1].get_xlim() != (3.0, 4.0)


def test_ticks_between_decades_where_few_are_shown():
    counts = []
    for decades in (2, 6):
        axes = Figure().subplots()
        axes.plot([1.0, 2.0], [1.0, 10.0**decades])
        logarithmic(axes)
        counts.append(len(axes.yaxis.get_minorticklocs()))
        assert np.allclose(np.log10(axes.get_ylim()), [0, decades], atol=0.5)
    assert counts[0] > 8
    assert counts[1] == 0
