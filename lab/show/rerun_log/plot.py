"""Plots for a viewer without X-Y plots: axes, lines and points in a 2D view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from lab.show.drawing import Axes

AXIS = (150, 150, 150)
TEXT = (225, 225, 225)


def log_axes(stream: rr.RecordingStream, origin: str, axes: Axes) -> None:
    """Logs frame and ticks at `origin`; what the axes are is for the name of the view to say."""
    stream.log(origin, rr.LineStrips2D(axes.frame(), colors=AXIS, radii=-0.75), static=True)
    points, texts = axes.tick_labels()
    log_texts(stream, f"{origin}/ticks", points, texts)


def log_texts(stream: rr.RecordingStream, entity: str, points: np.ndarray, texts: Sequence[str]) -> None:
    """Logs texts at points; the points themselves are too small to see."""
    marks = rr.Points2D(points, labels=list(texts), radii=1e-6, colors=TEXT, show_labels=True)
    stream.log(entity, marks, static=True)


def plot_view(origin: str, name: str, axes: Axes, *, above: float = 6.0, below: float = 14.0) -> rrb.View:
    """A view of the whole plot with room for labels on all sides, in canvas units."""
    bounds = rrb.VisualBounds2D(x_range=(-18.0, axes.width + 8.0), y_range=(-above, axes.height + below))
    return rrb.Spatial2DView(origin=origin, name=name, visual_bounds=bounds)


def plain(text: str) -> str:
    """Text that Markdown leaves as it is."""
    return "".join(f"\\{c}" if c in "\\`*_{}[]<>#|!~" else c for c in text.replace("\n", " "))
