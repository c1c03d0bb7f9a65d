"""Plots for a viewer without X-Y plots: axes, lines and points in a 2D view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from lab.show.drawing import Axes, rgb

AXIS = (150, 150, 150)
TEXT = (225, 225, 225)
KEYS = 6
"""Entries of a legend side by side."""


@dataclass(frozen=True, eq=False)
class Curve:
    """What one entry of a legend stands for.

    Attributes:
        name: in the legend.
        x, y: shape (n,); a line is broken where y is NaN.
        color: #RRGGBB.
        dots: whether points are drawn in place of a line.
        radius: of line or dots, in pixels.
    """

    name: str
    x: np.ndarray
    y: np.ndarray
    color: str
    dots: bool = False
    radius: float = 1.0


def log_plot(
    stream: rr.RecordingStream, origin: str, name: str, axes: Axes, curves: Sequence[Curve]
) -> rrb.View:
    """Logs curves with axes and a legend, values beyond the axes at their edge; the view that shows them."""
    log_axes(stream, origin, axes)
    for number, curve in enumerate(curves):
        x, y = np.clip(curve.x, *axes.x), np.clip(curve.y, *axes.y)
        entity, color = f"{origin}/curves/{number}", rgb(curve.color)
        known = np.isfinite(x) & np.isfinite(y)
        if curve.dots:
            stream.log(
                entity,
                rr.Points2D(axes.at(x[known], y[known]), colors=color, radii=-curve.radius),
                static=True,
            )
        else:
            # A run of numbers that are known makes a line of its own.
            runs = np.split(np.arange(x.size), np.flatnonzero(np.diff(known.astype(int))) + 1)
            strips = [axes.at(x[run], y[run]) for run in runs if run.size > 1 and known[run[0]]]
            stream.log(entity, rr.LineStrips2D(strips, colors=color, radii=-curve.radius), static=True)
    rows = _log_legend(stream, origin, axes, curves)
    return plot_view(origin, name, axes, below=16.0 + 0.14 * axes.height * rows)


def _log_legend(stream: rr.RecordingStream, origin: str, axes: Axes, curves: Sequence[Curve]) -> int:
    """Logs a dot and a name for every curve below the axes; the number of rows."""
    columns = min(KEYS, len(curves))
    for number, curve in enumerate(curves):
        row, column = divmod(number, columns)
        place = [[(column + 0.5) * axes.width / columns, axes.height * (1.1 + 0.14 * row) + 4]]
        key = rr.Points2D(place, colors=rgb(curve.color), radii=-4.0, labels=[curve.name], show_labels=True)
        stream.log(f"{origin}/legend/{number}", key, static=True)
    return -(-len(curves) // columns) if curves else 0


def log_axes(stream: rr.RecordingStream, origin: str, axes: Axes) -> None:
    """Logs frame and ticks at `origin`; what the axes are is for the name of the view to say."""
    stream.log(origin, rr.LineStrips2D(axes.frame(), colors=AXIS, radii=-0.75), static=True)
    points, texts = axes.tick_labels()
    log_texts(stream, f"{origin}/ticks", points, texts)


def log_texts(
    stream: rr.RecordingStream,
    entity: str,
    points: np.ndarray,
    texts: Sequence[str],
    *,
    inks: np.ndarray | None = None,
) -> None:
    """Logs texts at points, in colours of their own where given; the points themselves are too small to see."""
    marks = rr.Points2D(
        points, labels=list(texts), radii=1e-6, colors=TEXT if inks is None else inks, show_labels=True
    )
    stream.log(entity, marks, static=True)


def plot_view(origin: str, name: str, axes: Axes, *, above: float = 6.0, below: float = 14.0) -> rrb.View:
    """A view of the whole plot with room for labels on all sides, in canvas units."""
    bounds = rrb.VisualBounds2D(x_range=(-18.0, axes.width + 8.0), y_range=(-above, axes.height + below))
    return rrb.Spatial2DView(origin=origin, name=name, visual_bounds=bounds)


def plain(text: str) -> str:
    """Text that Markdown leaves as it is."""
    return "".join(f"\\{c}" if c in "\\`*_{}[]<>#|!~" else c for c in text.replace("\n", " "))
