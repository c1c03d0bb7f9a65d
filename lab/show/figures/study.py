"""Figures of a study: shares, coverage, errors and means over what was varied."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.show.drawing import SERIES
from lab.show.figures.canvas import DASHES, Drawing, drawing, few_ticks, logarithmic, plain, stacked
from lab.studies.axes import Axis
from lab.studies.outcome import Outcome
from lab.studies.statistics import NOMINAL, Statistic
from lab.studies.wording import told, words

MAX_LINES = 6
FIGURES = {
    "share": "Share of runs that succeed, and of true modes found",
    "coverage": "Coverage: share of error bars of two standard deviations that hold the truth; dotted, the nominal 95.45 %",
    "rms": "RMS errors, relative to the truth",
    "mean": "Means over the runs",
}
"""Kinds of statistic, each with its figure."""


@dataclass(frozen=True)
class Layout:
    """What of a study runs along x, and which points make a line.

    Attributes:
        label: of x.
        values: of x, one per step.
        numeric: whether they are numbers.
        lines: names and points (n_steps,) of the lines.
        left_out: how many more lines there would be.
    """

    label: str
    values: Sequence[Any]
    numeric: bool
    lines: tuple[tuple[str, np.ndarray], ...]
    left_out: int


def draw_study(outcome: Outcome) -> list[Drawing]:
    """One figure for each kind of statistic; none where nothing was varied."""
    layout = arranged(outcome.study.axes)
    if layout is None:
        return []
    drawings = []
    for kind, caption in FIGURES.items():
        chosen = [each for each in outcome.statistics if each.kind == kind]
        if chosen:
            drawings.append(_figure(kind, caption, chosen, layout))
    return drawings


def arranged(axes: Sequence[Axis]) -> Layout | None:
    """The first axis of numbers along x, or else the first; a line for each step of the others."""
    long = [k for k, axis in enumerate(axes) if len(axis) > 1]
    if not long:
        return None
    k = next((k for k in long if _numeric(axes[k])), long[0])
    shape = [len(axis) for axis in axes]
    points = np.moveaxis(np.arange(np.prod(shape)).reshape(shape), k, -1).reshape(-1, shape[k])
    others = [axis for j, axis in enumerate(axes) if j != k]
    names = [_name(others, line) for line in range(min(len(points), MAX_LINES))]
    lines = tuple(zip(names, points, strict=False))
    return Layout(axes[k].paths[0], axes[k].values[0], _numeric(axes[k]), lines, len(points) - len(lines))


def _figure(kind: str, caption: str, chosen: Sequence[Statistic], layout: Layout) -> Drawing:
    def paint(figure: Figure) -> None:
        frames = stacked(figure, len(chosen))[:, 0]
        for axes, statistic in zip(frames, chosen, strict=True):
            _curves(axes, statistic, layout)
        _below(frames[-1], layout)
        if len(layout.lines) > 1:
            figure.legend(*frames[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)

    text = f"{caption}, over {layout.label}. Bars: intervals of about 95 % from the scatter of the runs."
    if layout.left_out:
        text += f" {layout.left_out} more lines are in the table and in study.h5."
    return drawing(f"study-{kind}", 0.9 + 1.3 * len(chosen), text, paint)


def _curves(axes: Axes, statistic: Statistic, layout: Layout) -> None:
    x = (
        np.asarray(layout.values, dtype=float)
        if layout.numeric
        else np.arange(len(layout.values), dtype=float)
    )
    order = np.argsort(x)
    for k, (name, points) in enumerate(layout.lines):
        at = points[order]
        value, low, high = statistic.value[at], statistic.low[at], statistic.high[at]
        bars = np.maximum(np.stack([value - low, high - value]), 0)
        style = DASHES[k % len(DASHES)] if layout.numeric else ""
        axes.errorbar(
            x[order],
            value,
            bars,
            label=plain(name, 60),
            color=SERIES[k],
            linestyle=style,
            marker=".",
            capsize=2,
        )
    if statistic.kind in ("share", "coverage"):
        axes.set_ylim(-0.03, 1.03)
    if statistic.kind == "coverage":
        axes.axhline(NOMINAL, color="0.45", linestyle=":", linewidth=0.8, zorder=0)
    positive = statistic.value[np.isfinite(statistic.value) & (statistic.value > 0)]
    if statistic.kind == "rms" and positive.size and positive.max() > 10 * positive.min():
        logarithmic(axes)
    else:
        few_ticks(axes, 4)
    if layout.numeric and _wide(x):
        axes.set_xscale("log")
    axes.set_ylabel(plain(words(statistic), 24), rotation=0, ha="right", va="center")


def _below(axes: Axes, layout: Layout) -> None:
    axes.set_xlabel(plain(layout.label, 60))
    if not layout.numeric:
        axes.set_xticks(range(len(layout.values)), [plain(told(value), 16) for value in layout.values])
    elif _wide(np.asarray(layout.values, dtype=float)) or len(layout.values) <= 8:
        axes.set_xticks(layout.values, [f"{value:g}" for value in layout.values])
        axes.set_xticks([], minor=True)


def _numeric(axis: Axis) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in axis.values[0])


def _wide(x: np.ndarray) -> bool:
    return bool(x.min() > 0 and x.max() >= 10 * x.min())


def _name(others: Sequence[Axis], line: int) -> str:
    steps = np.unravel_index(line, [len(axis) for axis in others]) if others else ()
    setting = {
        path: value
        for axis, step in zip(others, steps, strict=True)
        if len(axis) > 1
        for path, value in axis.setting(int(step)).items()
    }
    return ", ".join(f"{path.rpartition('.')[2]} {told(value)}" for path, value in setting.items())
