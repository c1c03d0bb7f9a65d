"""Stabilization diagram: poles of every order over the spectrum, the rejected ones by reason."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from identification.stability import NAMES, STABLE
from lab.result import Result
from lab.show.drawing import SERIES, Axes, rgb
from lab.show.rerun_log.plot import log_axes, log_texts, plot_view
from lab.show.rerun_log.scene import join
from lab.show.signals import Spectra, mean_density, upper_frequency

ORIGIN = "/modes/stabilization"
REJECTED = (SERIES[1], SERIES[3], SERIES[4], SERIES[5], SERIES[0], SERIES[7])
PER_ROW = 3
"""Entries of the legend side by side."""
FAINT = (120, 120, 120)


def log_stabilization(stream: rr.RecordingStream, result: Result, spectrum: Spectra | None) -> list[rrb.View]:
    """Logs the diagram over the mean spectrum; one view, or none where a single order was asked for."""
    diagram = result.stabilization
    if diagram is None or not diagram.frequency_hz.size:
        return []
    top = upper_frequency(result.sample_rate, result.modes.frequency_hz)
    axes = Axes((0.0, top), (0.0, 1.05 * float(np.max(diagram.orders))), 300.0, 140.0)
    log_axes(stream, ORIGIN, axes)
    _log_spectrum(stream, axes, spectrum)
    _log_modes(stream, axes, result)
    points, labels = axes.at(diagram.frequency_hz, diagram.orders), np.array(diagram.label)
    reasons = [name for name in NAMES if name in diagram.label]
    for number, reason in enumerate(reasons):
        own = labels == reason
        shown = own & (diagram.frequency_hz <= top)
        color = rgb(SERIES[2] if reason == STABLE else REJECTED[(number - 1) % len(REJECTED)])
        radius = (-3.0 if diagram.orders.max() <= 50 else -2.0) if reason == STABLE else -1.5
        entity = f"{ORIGIN}/{STABLE}" if reason == STABLE else join(ORIGIN, "rejected", reason)
        stream.log(entity, rr.Points2D(points[shown], colors=color, radii=radius), static=True)
        row, column = divmod(number, PER_ROW)
        place = [[(column + 0.5) * axes.width / PER_ROW, axes.height + 14 + 24 * row]]
        text = f"{reason} ({int(own.sum())})"
        key = rr.Points2D(place, colors=color, radii=-4.0, labels=[text], show_labels=True)
        stream.log(f"{ORIGIN}/legend/{number}", key, static=True)
    beyond = int(np.sum(diagram.frequency_hz > top))
    name = "Stabilization diagram: model order over frequency [Hz], spectrum behind (six decades)"
    cut = f"; {beyond} poles lie above {top:.4g} Hz" if beyond else ""
    return [
        plot_view(
            ORIGIN, name + cut, axes, above=24.0, below=12.0 + 24.0 * (1 + (len(reasons) - 1) // PER_ROW)
        )
    ]


def _log_spectrum(stream: rr.RecordingStream, axes: Axes, spectrum: Spectra | None) -> None:
    """The mean spectrum over six decades, as a backdrop."""
    if spectrum is None:
        return
    density = mean_density(spectrum)
    if not density.max() > 0:
        return
    level = np.clip(1 + np.log10(np.maximum(density / density.max(), 1e-300)) / 6, 0, 1)
    shown = spectrum.frequency_hz <= axes.x[1]
    curve = axes.at(spectrum.frequency_hz[shown], level[shown] * axes.y[1])
    line = rr.LineStrips2D([curve], colors=FAINT, radii=-1.0, draw_order=0.0)
    stream.log(f"{ORIGIN}/spectrum", line, static=True)


def _log_modes(stream: rr.RecordingStream, axes: Axes, result: Result) -> None:
    """A line and its frequency at every accepted mode."""
    frequency = result.modes.frequency_hz
    if not frequency.size:
        return
    feet = axes.at(frequency, np.zeros(frequency.size))
    lines = [np.array([foot, [foot[0], 0.0]]) for foot in feet]
    stream.log(f"{ORIGIN}/modes", rr.LineStrips2D(lines, colors=rgb(SERIES[2]), radii=-0.5), static=True)
    # Alternating rows, and no text where the neighbour's already stands.
    place: list[tuple[float, float]] = []
    texts: list[str] = []
    ends = [0.0, 0.0]
    for number, (x, _) in enumerate(feet):
        row = number % 2
        if x >= ends[row]:
            place.append((x, -11.0 - 10.0 * row))
            texts.append(f"{frequency[number]:.4g}")
            ends[row] = x + 20.0
    if texts:
        log_texts(stream, f"{ORIGIN}/frequencies", np.array(place), texts)
