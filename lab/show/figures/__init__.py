"""The figures of the report, as SVG. The only place that imports matplotlib."""

from __future__ import annotations

from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.result import Result
from lab.show.figures.canvas import Drawing
from lab.show.figures.error_bars import error_bars
from lab.show.figures.modes import mac_table, matrix_maps, mode_shapes, singular_values, stabilization_diagram
from lab.show.figures.responses import coherences, nyquist, responses
from lab.show.figures.signals import output_spectra, time_histories
from lab.show.response_spectra import drawable, response_spectra
from lab.show.signals import spectra

__all__ = ["Drawing", "draw", "matrix_maps"]


def draw(result: Result, recording: Recording | FrequencyResponse) -> list[Drawing]:
    """All figures that the data support, in the order of the report."""
    if isinstance(recording, FrequencyResponse):
        return _of_responses(result, recording)
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


def _of_responses(result: Result, response: FrequencyResponse) -> list[Drawing]:
    """Figures of a result from frequency responses alone."""
    measured, result = response_spectra(response), drawable(result, response)
    drawings = [
        responses(response, measured, result),
        nyquist(response, measured, result),
        mode_shapes(result),
        error_bars(result),
        stabilization_diagram(result, measured),
        mac_table(result),
        singular_values(result),
    ]
    return [drawing for drawing in drawings if drawing is not None]
