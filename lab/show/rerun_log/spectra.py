"""Spectra of a diagnosis in the viewer: measured and predicted, in decibels over frequency."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from lab.diagnosis.outcome import SpectralPrediction
from lab.show.drawing import SERIES, Axes, rgb
from lab.show.rerun_log.plot import log_axes, plot_view
from lab.show.rerun_log.scene import join

COLORS = {"measured": SERIES[7], "nominal": SERIES[1], "calibrated": SERIES[4], "extended": SERIES[0]}
RANGE_DB = 80.0
"""Shown below the largest value."""


def log_spectra(
    stream: rr.RecordingStream, spectra: SpectralPrediction, rows: list[int], models: tuple[str, ...]
) -> list[rrb.View]:
    """Logs one plot per row; the views."""
    views = []
    # Powers are of the square of the unit, magnitudes of the unit itself.
    factor = 10.0 if all(unit.endswith("^2/Hz") for unit in spectra.units) else 20.0
    for row in rows:
        origin = join("/spectra", spectra.names[row])
        top = factor * np.log10(max(float(np.max(spectra.measured[row])), 1e-300))
        axes = Axes(
            (0.0, float(spectra.frequency_hz[-1])), (float(top - RANGE_DB), float(top + 10)), 320.0, 60.0
        )
        log_axes(stream, origin, axes)
        for model in ("measured", *models):
            level = factor * np.log10(np.maximum(getattr(spectra, model)[row], 1e-300))
            points = axes.at(spectra.frequency_hz, np.clip(level, *axes.y))
            radius = -1.5 if model == "measured" else -0.75
            line = rr.LineStrips2D([points], colors=rgb(COLORS[model]), radii=radius)
            stream.log(f"{origin}/{model}", line, static=True)
        name = f"{spectra.names[row]} [dB re 1 {spectra.units[row]}] over frequency [Hz]"
        views.append(plot_view(origin, name, axes))
    return views
