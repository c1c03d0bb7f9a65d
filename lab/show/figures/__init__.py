"""The figures of the report, as SVG. The only place that imports matplotlib."""

from __future__ import annotations

from identification.recording import Recording
from lab.result import Result
from lab.show.figures.canvas import Drawing
from lab.show.figures.error_bars import error_bars
from lab.show.figures.modes import mac_table, matrix_maps, mode_shapes, singular_values, stabilization_diagram
from lab.show.figures.responses import coherences, nyquist, responses
from lab.show.figures.signals import output_spectra, time_histories
from lab.show.signals import spectra

__all__ = ["Drawing", "draw", "matrix_maps"]


def draw(result: Result, recording: Recording) -> list[Drawing]:
    """All figures that the data support, in the order of the report."""
    spectrum = spectra(recording)
    drawings = [
        time_histories(recording),
        None if spectrum is None else output_spectra(recording, spectrum, result),
        None if spectrum is None else responses(recording, spectrum, result),
        None if spectrum is None else nyquist(recording, spectrum, result),
        None if spectrum is None else coherences(recording, spectrum, result),
        mode_shapes(result),
        error_bars(result),
        stabilization_diagram(result, spectrum),
        mac_table(result),
        singular_values(result),
    ]
    return [drawing for drawing in drawings if drawing is not None]
