"""The force of the guilty spring in the viewer: from the measurements, the law found, the linear spring."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from lab.diagnosis.restoring import Restoring
from lab.show.drawing import SERIES, Axes, rgb, round_range
from lab.show.rerun_log.plot import log_axes, plot_view

ORIGIN = "/restoring"
GREY = (150, 150, 150)
AXIS = {"extension": "extension [m]", "rate": "rate of extension [m/s]"}


def log_restoring(stream: rr.RecordingStream, restoring: Restoring) -> rrb.View:
    """Logs the points; one view."""
    x = np.concatenate([restoring.x, restoring.law_x])
    force = np.concatenate([restoring.force, restoring.law_force])
    axes = Axes(round_range(x), round_range(force), 240.0, 130.0)
    log_axes(stream, ORIGIN, axes)
    ends = np.array([restoring.law_x.min(), restoring.law_x.max()])
    line = rr.LineStrips2D([axes.at(ends, restoring.linear * ends)], colors=rgb(SERIES[4]), radii=-1.0)
    stream.log(f"{ORIGIN}/linear", line, static=True)
    # The law lies on the broader dots of the measurements.
    for name, points, color, radius, order in (
        ("measured", axes.at(restoring.x, restoring.force), GREY, -3.0, 31.0),
        ("law", axes.at(restoring.law_x, restoring.law_force), rgb(SERIES[0]), -1.5, 32.0),
    ):
        dots = rr.Points2D(points, colors=color, radii=radius, draw_order=order)
        stream.log(f"{ORIGIN}/{name}", dots, static=True)
    keys = ("from the measurements", "the law found", "calibrated, without the finding")
    places = [[axes.width * (0.1 + 0.3 * i), axes.height + 22] for i in range(3)]
    colors = [GREY, rgb(SERIES[0]), rgb(SERIES[4])]
    key = rr.Points2D(places, colors=colors, radii=-4.0, labels=list(keys), show_labels=True)
    stream.log(f"{ORIGIN}/legend", key, static=True)
    name = f"Force of {restoring.location} [N] over {AXIS[restoring.over]}"
    return plot_view(ORIGIN, name, axes, below=34.0)
