"""Frequency responses in the viewer: magnitudes in decibels over frequency, measured and of the identified model."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from identification.response import FrequencyResponse
from lab.result import Result
from lab.show.drawing import SERIES, Axes
from lab.show.rerun_log.plot import Curve, log_plot
from lab.show.rerun_log.scene import join
from lab.show.rerun_log.spectra import decibels, level_range, log_mode_lines

MOST = 6
"""Responses shown."""


def log_responses(stream: rr.RecordingStream, result: Result, response: FrequencyResponse) -> list[rrb.View]:
    """Logs the magnitude of a few responses; the views, one per pair of channels.

    Args:
        stream: where to.
        result: with the model identified.
        response: as measured.
    """
    f, system = response.frequency_hz, result.realization.system
    model = system.frequency_response(f)
    views = []
    pairs = [(i, j) for j in range(len(response.inputs)) for i in range(len(response.outputs))]
    for i, j in pairs[:MOST]:
        output, drive = response.outputs[i], response.inputs[j]
        levels = [decibels(np.abs(H[:, i, j]), factor=20.0) for H in (response.values, model)]
        axes = Axes((0.0, float(f[-1])), level_range(levels), 440.0, 80.0)
        origin = join("/test/responses", f"{output.name} by {drive.name}")
        curves = [
            Curve("measured", f, levels[0], SERIES[7], radius=1.5),
            Curve("identified", f, levels[1], SERIES[0], radius=0.75),
        ]
        title = f"{output.name} / {drive.name} [dB re 1 ({output.unit})/{drive.unit}] over frequency [Hz]"
        views.append(log_plot(stream, origin, title, axes, curves))
        log_mode_lines(stream, origin, axes, result.modes.frequency_hz)
    return views
