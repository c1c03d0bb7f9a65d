"""What each model leaves of a recording, in the viewer: over time, over frequency and over amplitude."""

from __future__ import annotations

import itertools

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from identification.recording import Array, Record, Recording
from lab.diagnosis.outcome import Diagnosis
from lab.show.drawing import Axes, rgb, round_range
from lab.show.rerun_log.plot import Curve, log_plot
from lab.show.rerun_log.scene import TIMELINE, join
from lab.show.rerun_log.spectra import COLORS, log_levels
from lab.show.residuals import (
    CLOSE_UP,
    LABELS,
    levels,
    residual,
    residual_spectra,
    shown_models,
    worst_stretch,
)
from lab.show.signals import envelope, spectra

PLOT = (200.0, 90.0)
"""Width and height of a plot on its canvas."""
AROUND = 10
"""Length of the stretch that is logged sample by sample, in close-ups."""


def log_predictions(
    stream: rr.RecordingStream, diagnosis: Diagnosis, recording: Recording, rows: list[int]
) -> list[rrb.View]:
    """Logs outputs measured and predicted; a view each, which opens at the stretch that the calibrated model misses most."""
    number, start = worst_stretch(diagnosis, CLOSE_UP)
    lengths = [p.measured.shape[1] for p in diagnosis.predictions]
    begin = sum(lengths[:number]) + start
    shown = begin / recording.sample_rate, (begin + CLOSE_UP) / recording.sample_rate
    # Cut there, so that the close-up is no envelope.
    half = (AROUND - 1) * CLOSE_UP // 2
    cuts = {number: (max(0, start - half), min(lengths[number], start + CLOSE_UP + half))}
    models = ("measured", *shown_models(diagnosis))
    views = []
    for row in rows:
        lines = {name: [getattr(p, name)[row] for p in diagnosis.predictions] for name in models}
        views.append(_log_lines(stream, "/predictions", recording, row, lines, shown=shown, cuts=cuts))
    return views


def log_over_time(
    stream: rr.RecordingStream, diagnosis: Diagnosis, recording: Recording, rows: list[int]
) -> list[rrb.View]:
    """Logs measured less predicted outputs; a view each."""
    models = shown_models(diagnosis)
    whole = 0.0, sum(p.measured.shape[1] for p in diagnosis.predictions) / recording.sample_rate
    return [
        _log_lines(
            stream,
            "/residuals",
            recording,
            row,
            {name: [residual(p, name)[row] for p in diagnosis.predictions] for name in models},
            shown=whole,
            cuts={},
        )
        for row in rows
    ]


def log_over_frequency(
    stream: rr.RecordingStream, diagnosis: Diagnosis, recording: Recording, rows: list[int]
) -> list[rrb.View]:
    """Logs spectral densities of outputs and of what each model leaves; a view each, none for short records."""
    measured = spectra(recording)
    left = {model: residual_spectra(diagnosis, recording, model) for model in shown_models(diagnosis)}
    if measured is None:
        return []
    views = []
    for row in rows:
        channel = recording.outputs[row]
        powers = {"measured": measured.output_density[row, 1:]}
        powers |= {name: s.output_density[row, 1:] for name, s in left.items() if s is not None}
        origin = join("/residual_spectra", channel.name)
        name = f"{channel.name}: residual [dB re 1 ({channel.unit})²/Hz] over frequency [Hz]"
        views.append(log_levels(stream, origin, name, measured.frequency_hz[1:], powers, size=PLOT))
    return views


def log_over_amplitude(
    stream: rr.RecordingStream, diagnosis: Diagnosis, recording: Recording, rows: list[int]
) -> list[rrb.View]:
    """Logs RMS left against RMS measured, a point for each short stretch of time; a view each."""
    parts = levels(diagnosis, recording.sample_rate)
    views = []
    for row in rows:
        channel = recording.outputs[row]
        motion = np.concatenate([part.measured[row] for part in parts])
        left = {
            model: np.concatenate([part.residual[model][row] for part in parts])
            for model in shown_models(diagnosis)
        }
        axes = Axes(
            round_range(np.append(motion, 0.0)), round_range(np.append(list(left.values()), 0.0)), *PLOT
        )
        curves = [
            Curve(LABELS[model], motion, values, COLORS[model], dots=True, radius=2.0)
            for model, values in left.items()
        ]
        name = f"{channel.name}: RMS residual over RMS measured [{channel.unit}]"
        views.append(log_plot(stream, join("/residual_amplitude", channel.name), name, axes, curves))
    return views


def _log_lines(
    stream: rr.RecordingStream,
    above: str,
    recording: Recording,
    row: int,
    lines: dict[str, list[Array]],
    *,
    shown: tuple[float, float],
    cuts: dict[int, tuple[int, int]],
) -> rrb.View:
    """Logs signals of one channel as one line each, records one after the other; one view.

    Args:
        stream: where to.
        above: entity under which the channel is logged.
        recording: whose channel it is.
        row: of the channel.
        lines: signals by name, one array per record.
        shown: first and last time of the view [s].
        cuts: by record, samples between which nothing becomes an envelope.
    """
    channel, rate = recording.outputs[row], recording.sample_rate
    origin, start = join(above, channel.name), 0.0
    times: list[Array] = []
    values: list[Array] = []
    for number, parts in enumerate(zip(*lines.values(), strict=True)):
        signal = np.stack(parts)
        if times and signal.shape[1]:
            # A gap between records, so that no line joins them.
            times.append(np.array([start - 1e-9]))
            values.append(np.full((len(parts), 1), np.nan))
        edges = (0, *cuts.get(number, ()), signal.shape[1])
        for first, last in itertools.pairwise(edges):
            piece = envelope(Record("other", np.zeros((0, 0)), signal[:, first:last]), rate)
            times.append(start + first / rate + piece.time)
            values.append(piece.outputs)
        start += signal.shape[1] / rate
    names = list(lines)
    style = rr.SeriesLines(
        names=[LABELS[name] for name in names],
        colors=[rgb(COLORS[name]) for name in names],
        widths=[2.5 if name == "measured" else 1.0 for name in names],
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    stream.log(origin, style, static=True)
    stream.send_columns(
        origin,
        [rr.TimeColumn(TIMELINE, duration=np.concatenate(times))],
        rr.Scalars.columns(scalars=np.ascontiguousarray(np.concatenate(values, axis=1).T)),
    )
    ends = (rr.TimeRangeBoundary.absolute(seconds=t) for t in shown)
    what = "measured and predicted" if "measured" in names else "measured less predicted"
    return rrb.TimeSeriesView(
        origin=origin,
        name=f"{channel.name} [{channel.unit}], {what}",
        plot_legend=rrb.PlotLegend(corner="RightTop"),
        axis_x=rrb.TimeAxis(view_range=rr.TimeRange(*ends)),
    )
