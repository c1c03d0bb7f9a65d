"""The figures of the report, as SVG. The only place that imports matplotlib."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from identification.progress import UNHEARD, Work
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

OVER_FREQUENCY = (output_spectra, responses, nyquist, coherences)
Figure = Callable[[], Drawing | None]
"""Draws one, where the data support it."""


def draw(result: Result, recording: Recording | FrequencyResponse, *, work: Work = UNHEARD) -> list[Drawing]:
    """All figures that the data support, in the order of the report, each told of as it is drawn."""
    figures = (
        _of_responses(result, recording)
        if isinstance(recording, FrequencyResponse)
        else _of_samples(result, recording)
    )
    drawings = [figure() for figure in work.each(figures)]
    return [drawing for drawing in drawings if drawing is not None]


def _of_samples(result: Result, recording: Recording) -> list[Figure]:
    """Figures of a result from a recording."""
    spectrum = spectra(recording)
    return [
        partial(time_histories, recording),
        *(
            []
            if spectrum is None
            else [partial(figure, recording, spectrum, result) for figure in OVER_FREQUENCY]
        ),
        partial(mode_shapes, result),
        partial(error_bars, result),
        partial(stabilization_diagram, result, spectrum),
        partial(mac_table, result),
        partial(singular_values, result),
    ]


def _of_responses(result: Result, response: FrequencyResponse) -> list[Figure]:
    """Figures of a result from frequency responses alone."""
    measured, result = response_spectra(response), drawable(result, response)
    return [
        partial(responses, response, measured, result),
        partial(nyquist, response, measured, result),
        partial(mode_shapes, result),
        partial(error_bars, result),
        partial(stabilization_diagram, result, measured),
        partial(mac_table, result),
        partial(singular_values, result),
    ]
