"""Channels over time: one vector entity per unit, in columns, as envelopes when the record is long."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from identification.recording import Channel, Recording
from lab.show.drawing import SERIES, rgb
from lab.show.rerun_log.scene import TIMELINE
from lab.show.signals import envelope


def log_channels(stream: rr.RecordingStream, recording: Recording) -> list[rrb.View]:
    """Logs outputs and inputs, records one after the other on the time line; one view per unit."""
    envelopes = [envelope(record, recording.sample_rate) for record in recording.records]
    lengths = [record.n_samples / recording.sample_rate for record in recording.records]
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    views: list[rrb.View] = []
    sides: list[tuple[str, tuple[Channel, ...]]] = [
        ("inputs", recording.inputs),
        ("outputs", recording.outputs),
    ]
    first, last = (rr.TimeRangeBoundary.absolute(seconds=float(t)) for t in (0.0, starts[-1]))
    whole = rrb.TimeAxis(view_range=rr.TimeRange(start=first, end=last))
    for side, channels in sides:
        signals = [getattr(part, side) for part in envelopes]
        for unit, rows in by_unit(channels).items():
            origin = f"/test/{side}/{slug(channels[rows[0]])}"
            time, values = _joined(
                [
                    (start + part.time, signal[rows])
                    for start, part, signal in zip(starts, envelopes, signals, strict=False)
                    if signal.shape[0]
                ]
            )
            if not time.size:
                continue
            stream.log(
                origin, _lines([channels[row].name for row in rows], held=side == "inputs"), static=True
            )
            stream.send_columns(
                origin,
                [rr.TimeColumn(TIMELINE, duration=time)],
                rr.Scalars.columns(scalars=np.ascontiguousarray(values.T)),
            )
            quantity = channels[rows[0]].quantity
            legend = rrb.PlotLegend(corner="RightTop")
            views.append(
                rrb.TimeSeriesView(
                    origin=origin, name=f"{quantity} [{unit}], {side}", plot_legend=legend, axis_x=whole
                )
            )
    return views


def by_unit(channels: Sequence[Channel]) -> dict[str, list[int]]:
    """Positions of the channels of each unit."""
    groups: dict[str, list[int]] = {}
    for row, channel in enumerate(channels):
        groups.setdefault(channel.unit, []).append(row)
    return groups


def slug(channel: Channel) -> str:
    """A path part that tells quantity and unit."""
    return re.sub(r"[^a-z0-9]+", "_", f"{channel.quantity} {channel.unit}".lower())


def _joined(parts: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Records one after the other, with a gap (NaN) between them so that no line joins them."""
    times, values = [], []
    for number, (time, signal) in enumerate(parts):
        if number and time.size:
            times.append(time[:1] - 1e-9)
            values.append(np.full((signal.shape[0], 1), np.nan))
        times.append(time)
        values.append(signal)
    if not times:
        return np.zeros(0), np.zeros((0, 0))
    return np.concatenate(times), np.concatenate(values, axis=1)


def _lines(names: list[str], *, held: bool) -> rr.SeriesLines:
    """How the lines look; a force is held from sample to sample."""
    return rr.SeriesLines(
        names=names,
        colors=[rgb(color) for color in SERIES[: len(names)]] if len(names) <= 6 else None,
        widths=[1.0] * len(names),
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
        interpolation_mode=rr.components.InterpolationMode.StepAfter if held else None,
    )
