"""The force of the guilty spring: dots from the measurements, the law that was found, and the linear spring of the model."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from lab.diagnosis.restoring import Restoring
from lab.show.drawing import SERIES
from lab.show.figures.canvas import Drawing, drawing, few_ticks, plain

AXIS = {"extension": "extension [m]", "rate": "rate of extension [m/s]"}


def restoring_figure(restoring: Restoring, *, static: bool = True) -> Drawing:
    """Force over extension, or over its rate for a law of damping.

    Args:
        restoring: points from the measurements and of the law.
        static: whether any output senses where the structure stands, as accelerometers do not.
    """
    order = np.argsort(restoring.law_x)

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(
            restoring.x,
            restoring.force,
            linestyle="",
            marker=".",
            markersize=5.0,
            color="0.72",
            label="from the measurements",
        )
        ends = restoring.law_x[order[[0, -1]]]
        axes.plot(
            ends,
            restoring.linear * ends,
            color=SERIES[4],
            linestyle=(0, (5, 1.5)),
            label="calibrated, without the finding",
        )
        axes.plot(
            restoring.law_x,
            restoring.law_force,
            linestyle="",
            marker=".",
            markersize=1.6,
            color=SERIES[0],
            label="the law found",
        )
        axes.set_xlabel(AXIS[restoring.over])
        axes.set_ylabel(f"force of {plain(restoring.location, 20)} [N]")
        few_ticks(axes, 5)
        figure.legend(loc="outside upper center", ncols=3, markerscale=1.5)

    caption = (
        f"Force of the spring {restoring.location} over its {AXIS[restoring.over].partition(' [')[0]}. Dots: derived from the "
        "measured outputs and the linear rest of the model alone, without the law; where they follow the law found, the law "
        "is right. Their scatter is the noise of the measurements."
    )
    if not static:
        caption += (
            " Accelerometers do not sense constant forces, so the cloud of dots may be shifted as a whole."
        )
    return drawing("restoring-force", 3.2, caption, paint)
