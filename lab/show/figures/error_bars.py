"""Figure of the error bars: frequencies and damping ratios less the truth, mode by mode."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from lab.result import Result
from lab.show.drawing import SERIES
from lab.show.figures.canvas import Drawing, drawing, few_ticks
from lab.validation import COVERAGE


def error_bars(result: Result) -> Drawing | None:
    """Two panels of relative errors with their error bars; None where no error bar is known or all are zero."""
    modes = result.modes
    if modes.frequency_std is None or modes.damping_std is None or not len(modes):
        return None
    pairs = result.comparison.pairs if result.comparison else ()
    compared = bool(pairs)
    stable = [i for i in range(len(modes)) if result.stable[i]]
    rows = [pair.estimate for pair in pairs] if compared else stable or list(range(len(modes)))
    frequency_std, damping_std = modes.frequency_std[rows], modes.damping_std[rows]
    known = np.isfinite(frequency_std) & np.isfinite(damping_std) & (modes.damping_ratio[rows] != 0)
    if not known.any() or not np.any(frequency_std[known] > 0):
        return None
    zero = np.zeros(len(rows))
    frequency = np.array([pair.frequency_error for pair in pairs]) if compared else zero
    damping = np.array([pair.damping_error for pair in pairs]) if compared else zero
    number = np.array(rows) + 1

    def paint(figure: Figure) -> None:
        for axes, what, error, bar in zip(
            figure.subplots(1, 2),
            ("frequency", "damping ratio"),
            (frequency, damping),
            (frequency_std / modes.frequency_hz[rows], damping_std / np.abs(modes.damping_ratio[rows])),
            strict=True,
        ):
            _panel(axes, number[known], error[known], bar[known])
            axes.set_title(f"{what}, relative" if compared else f"{what}, relative to the estimate")

    caption = f"Error bars of ± {COVERAGE:g} standard deviations"
    caption += (
        ", around identified less true value, over the true one. The dashed line is the truth: about 95 % of the bars "
        "should meet it."
        if compared
        else ", over the identified value: how far the truth may be off."
    )
    if not compared and len(rows) < len(modes):
        caption += " Modes that do not stay put over the model orders are left out."
    return drawing("error-bars", 2.3, caption, paint)


def _panel(axes: Axes, number: np.ndarray, error: np.ndarray, bar: np.ndarray) -> None:
    axes.axhline(0, color="0.4", linestyle="--", linewidth=0.8)
    axes.errorbar(
        number,
        error,
        yerr=COVERAGE * bar,
        linestyle="",
        marker="o",
        markersize=3.5,
        color=SERIES[0],
        ecolor="black",
        elinewidth=0.9,
        capsize=3.0,
    )
    axes.set_xlabel("mode")
    axes.set_xlim(float(number.min()) - 0.5, float(number.max()) + 0.5)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    few_ticks(axes, 5)
