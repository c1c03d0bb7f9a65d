"""Figures of a placement: every layout by rank, the chosen channels on the structure, and the chances of confusion."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from lab.placement.outcome import Placement
from lab.rig import Rig
from lab.show import structure
from lab.show.drawing import SERIES
from lab.show.figures.canvas import Drawing, drawing, few_ticks, plain
from lab.show.marks import Mark, actuator_marks, sensor_marks
from lab.show.placements import PERCENT

MAX_POINTS = 2000
"""Of a curve."""
MAX_NAMED = 30
"""Channels up to this number carry their names."""
MAX_CAUSES = 20


def draw_placement(placement: Placement, rig: Rig) -> list[Drawing]:
    """All figures that the placement supports."""
    found = [ranking_figure(placement), layout_figure(placement, rig), confusion_figure(placement)]
    return [each for each in found if each is not None]


def ranking_figure(placement: Placement) -> Drawing | None:
    """The figure of every layout over its rank, with the named ones marked."""
    p, n = placement, placement.figures.size
    if n < 2:
        return None
    unit = 100.0 if p.target in PERCENT else 1.0

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        rows = np.unique(np.linspace(0, n - 1, MAX_POINTS).astype(int))
        axes.plot(rows + 1, unit * p.figures[rows], color=SERIES[7], label="all layouts")
        named = [
            row
            for row in p.ranking
            if row.rank and np.isfinite(row.figure) and not row.name.startswith("rank ")
        ]
        for k, row in enumerate(named):
            axes.plot(
                [float(row.rank or 0)],
                [unit * row.figure],
                linestyle="",
                marker="os^Dv*"[k % 6],
                color=SERIES[k % 6],
                label=f"{plain(row.name)}: rank {row.rank}",
            )
        axes.set_xlabel("rank")
        axes.set_ylabel("figure [%]" if unit == 100 else "figure")
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FuncFormatter(_number))
        axes.yaxis.set_minor_formatter(FuncFormatter(_few))
        figure.legend(loc="outside upper center", ncols=3)

    caption = f"All {n} layouts by rank: {p.measure}. Smaller is better."
    return drawing("placement-ranking", 3.0, caption, paint)


def layout_figure(placement: Placement, rig: Rig) -> Drawing:
    """The chosen channels on the structure, seen along its thinnest direction."""
    frames = structure.frames(rig, np.zeros((rig.model.nv, 1)))
    points = np.concatenate([frames.position.reshape(-1, 3), *[path.reshape(-1, 3) for path in frames.paths]])
    spread = np.ptp(points, axis=0)
    across, up = sorted(np.argsort(-spread, kind="stable")[:2])
    reach = 0.3 * structure.spacing(rig)
    sensors = sensor_marks(rig, placement.sensors)
    actuators = actuator_marks(rig, placement.actuators)

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        for path in frames.paths:
            axes.plot(path[0][:, across], path[0][:, up], color="0.75", zorder=0)
        axes.plot(
            frames.position[:, 0, across],
            frames.position[:, 0, up],
            "o",
            color="0.55",
            markersize=4,
            zorder=1,
        )
        for marks, color, name, side in (
            (sensors, SERIES[0], "sensors", 1.0),
            (actuators, SERIES[1], "actuators", -1.0),
        ):
            _arrows(
                axes,
                marks,
                (across, up),
                color,
                name,
                side * reach,
                len(sensors) + len(actuators) <= MAX_NAMED,
            )
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.12)
        axes.set_xlabel(f"{'xyz'[across]} [m]")
        axes.set_ylabel(f"{'xyz'[up]} [m]")
        few_ticks(axes, 5)
        if sensors or actuators:
            figure.legend(loc="outside upper center", ncols=2)

    caption = "The chosen sensors (full arrows, along what they read) and actuators (pointing the other way) on the structure."
    return drawing("placement-layout", 3.6, caption, paint)


def _arrows(
    axes: object, marks: list[Mark], view: tuple[int, int], color: str, name: str, reach: float, named: bool
) -> None:
    across, up = view
    if not marks:
        return
    points = np.array([mark.point for mark in marks])
    directions = np.array([mark.direction for mark in marks]) * reach
    axes.quiver(  # type: ignore[attr-defined]
        points[:, across],
        points[:, up],
        directions[:, across],
        directions[:, up],
        angles="xy",
        scale_units="xy",
        scale=1.0,
        color=color,
        width=0.006,
        label=name,
        zorder=3,
    )
    for mark, direction in zip(marks, directions, strict=True):
        if named:
            axes.annotate(  # type: ignore[attr-defined]
                plain(mark.name, 16),
                (mark.point[across] + 1.05 * direction[across], mark.point[up] + 1.05 * direction[up]),
                color=color,
                ha=_side(direction[across], "left", "right"),
                va=_side(direction[up], "bottom", "top"),
                fontsize=7,
            )


def _side(component: float, positive: str, negative: str) -> str:
    """How a label is aligned so that it begins where an arrow ends."""
    return "center" if abs(component) < 1e-9 else positive if component > 0 else negative


def _number(value: float, place: int | None = None) -> str:
    return f"{value:g}"


def _few(value: float, place: int | None = None) -> str:
    """Ticks between powers of ten: two and five alone carry numbers."""
    return f"{value:g}" if f"{value:e}"[0] in "25" else ""


def confusion_figure(placement: Placement) -> Drawing | None:
    """The causes most easily mistaken, as bars."""
    worst = placement.causes[:MAX_CAUSES]
    if not worst:
        return None

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        rows = np.arange(len(worst))[::-1]
        axes.barh(rows, [100 * cause.confusion for cause in worst], color=SERIES[0])
        axes.set_yticks(rows, [plain(f"{cause.cause} at {cause.location}", 40) for cause in worst])
        axes.set_xlabel("probability of naming the likeliest wrong cause [%]")

    caption = "The causes most easily mistaken with the layout chosen; those told apart by no layout are listed above."
    return drawing("placement-confusion", 0.5 + 0.2 * len(worst), caption, paint)
