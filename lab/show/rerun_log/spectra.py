"""Spectra in the viewer, in decibels over frequency: of the channels with their coherence, and of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from identification.recording import Recording
from lab.diagnosis.outcome import SpectralPrediction
from lab.show.drawing import SERIES, Axes, rgb
from lab.show.rerun_log.channels import by_unit, slug
from lab.show.rerun_log.plot import Curve, log_plot, log_texts
from lab.show.rerun_log.scene import join
from lab.show.residuals import LABELS
from lab.show.signals import Spectra, coherence, upper_frequency

COLORS = {"measured": SERIES[7], "nominal": SERIES[1], "calibrated": SERIES[4], "extended": SERIES[0]}
RANGE_DB = 100.0
"""Shown below the largest value at most."""
MAX_LINES = 6
"""Channels drawn one by one; of more, the mean."""
LINES = (*SERIES[:6], SERIES[7])
"""Colours that show on a dark ground."""


def log_channel_spectra(
    stream: rr.RecordingStream, recording: Recording, spectrum: Spectra | None, modes_hz: np.ndarray
) -> list[rrb.View]:
    """Logs spectral densities of the outputs, a plot per unit, and their coherence with the inputs; the views.

    Args:
        stream: where to.
        recording: whose channels the spectra are of.
        spectrum: averaged spectra, or None where there are none to show.
        modes_hz: frequencies of the identified modes, marked by thin lines.
    """
    if spectrum is None:
        return []
    top = upper_frequency(recording.sample_rate, modes_hz)
    shown = (spectrum.frequency_hz <= top) & (spectrum.frequency_hz > 0)
    if np.sum(shown) < 2:
        return []
    f, views = spectrum.frequency_hz[shown], []
    names = [channel.name for channel in recording.outputs]
    for unit, rows in by_unit(recording.outputs).items():
        origin = f"/test/spectra/{slug(recording.outputs[rows[0]])}"
        level = decibels(spectrum.output_density[rows][:, shown], factor=10.0)
        axes = Axes((0.0, top), level_range([level]), 440.0, 80.0)
        curves = _curves(f, level, [names[row] for row in rows])
        title = f"Spectral density [dB re 1 ({unit})²/Hz] over frequency [Hz]"
        views.append(log_plot(stream, origin, title, axes, curves))
        log_mode_lines(stream, origin, axes, modes_hz)
    explained = coherence(spectrum)
    if explained is not None:
        axes = Axes((0.0, top), (0.0, 1.0), 440.0, 80.0)
        title = f"Coherence of outputs with all inputs over frequency [Hz], {spectrum.n_averages} averages"
        curves = _curves(f, explained[:, shown], names)
        views.append(log_plot(stream, "/test/coherence", title, axes, curves))
        log_mode_lines(stream, "/test/coherence", axes, modes_hz)
    return views


def _curves(f: np.ndarray, values: np.ndarray, names: Sequence[str]) -> list[Curve]:
    """One curve per channel, or the least, mean and largest of many."""
    if len(names) <= MAX_LINES:
        return [
            Curve(name, f, row, color, radius=0.75)
            for name, row, color in zip(names, values, LINES, strict=False)
        ]
    of = f"of {len(names)} channels"
    return [
        Curve(f"largest {of}", f, np.max(values, axis=0), SERIES[7], radius=0.75),
        Curve(f"least {of}", f, np.min(values, axis=0), SERIES[7], radius=0.75),
        Curve(f"mean {of}", f, np.mean(values, axis=0), SERIES[5]),
    ]


def log_mode_lines(stream: rr.RecordingStream, origin: str, axes: Axes, modes_hz: np.ndarray) -> None:
    """Logs a thin line at every mode, with its number on top where there is room."""
    within = np.flatnonzero((modes_hz >= axes.x[0]) & (modes_hz <= axes.x[1]))
    if not within.size:
        return
    feet = axes.at(modes_hz[within], np.full(within.size, axes.y[0]))
    lines = [np.array([foot, [foot[0], 0.0]]) for foot in feet]
    marks = rr.LineStrips2D(lines, colors=rgb(SERIES[2]), radii=-0.4, draw_order=0.0)
    stream.log(f"{origin}/modes", marks, static=True)
    room, last, kept = 0.03 * axes.width, -np.inf, []
    for k, (x, _) in enumerate(feet):
        if x - last > room:
            kept.append(k)
            last = x
    places = np.stack([feet[kept, 0], np.full(len(kept), -0.11 * axes.height)], axis=1)
    log_texts(stream, f"{origin}/modes/numbers", places, [str(within[k] + 1) for k in kept])


def log_spectra(
    stream: rr.RecordingStream, spectra: SpectralPrediction, rows: list[int], models: tuple[str, ...]
) -> list[rrb.View]:
    """Logs measured and predicted spectra of a diagnosis, one plot per row; the views."""
    # Powers are of the square of the unit, magnitudes of the unit itself.
    factor = 10.0 if all(unit.endswith("^2/Hz") for unit in spectra.units) else 20.0
    views = []
    for row in rows:
        curves = {name: getattr(spectra, name)[row] for name in ("measured", *models)}
        name = f"{spectra.names[row]} [dB re 1 {spectra.units[row]}] over frequency [Hz]"
        origin = join("/spectra", spectra.names[row])
        views.append(log_levels(stream, origin, name, spectra.frequency_hz, curves, factor=factor))
    return views


def log_levels(
    stream: rr.RecordingStream,
    origin: str,
    name: str,
    frequency_hz: np.ndarray,
    values: Mapping[str, np.ndarray],
    *,
    factor: float = 10.0,
    size: tuple[float, float] = (440.0, 80.0),
) -> rrb.View:
    """Logs powers of the measured signal and of models over frequency, in decibels; the view.

    Args:
        stream: where to.
        origin: entity of the plot.
        name: of the view.
        frequency_hz: shape (n,).
        values: by the name of a model or "measured", (n,) each.
        factor: 10 for powers, 20 for magnitudes.
        size: width and height on the canvas.
    """
    levels = {model: decibels(value, factor=factor) for model, value in values.items()}
    axes = Axes((0.0, float(frequency_hz[-1])), level_range(list(levels.values())), *size)
    curves = [
        Curve(LABELS[model], frequency_hz, level, COLORS[model], radius=1.5 if model == "measured" else 0.75)
        for model, level in levels.items()
    ]
    return log_plot(stream, origin, name, axes, curves)


def decibels(values: np.ndarray, *, factor: float) -> np.ndarray:
    """Levels re 1 of powers (factor 10) or magnitudes (factor 20); NaN where there is nothing."""
    positive = np.where(values > 0, values, np.nan)
    return np.asarray(factor * np.log10(positive))


def level_range(levels: Sequence[np.ndarray]) -> tuple[float, float]:
    """Round limits [dB] around all levels, at most `RANGE_DB` apart."""
    known = np.concatenate([level[np.isfinite(level)] for level in levels])
    if not known.size:
        return -RANGE_DB, 0.0
    top = 10.0 * (np.floor(float(np.max(known)) / 10) + 1)
    return max(10.0 * np.floor(float(np.min(known)) / 10), top - RANGE_DB), top
