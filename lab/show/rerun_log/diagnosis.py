"""A diagnosis: measured against predictions, what each model leaves, and both structures side by side."""

from __future__ import annotations

import re
import uuid
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from identification.recording import Array, Record, Recording
from lab.diagnosis.outcome import Diagnosis
from lab.diagnosis.restoring import restoring_force
from lab.show import structure
from lab.show.diagnosed import Diagnosed, title_of
from lab.show.drawing import SERIES, rgb
from lab.show.findings import calibration_table, error_table, finding_table, verdict_of
from lab.show.rerun_log.plot import plain
from lab.show.rerun_log.restoring import log_restoring
from lab.show.rerun_log.scene import (
    MAX_NAMED,
    TIMELINE,
    join,
    log_frames,
    log_solids,
    motion_frames,
    view,
)
from lab.show.rerun_log.spectra import log_spectra
from lab.show.residuals import relative_errors, residual, shown_models, worst_rows
from lab.show.signals import envelope

if TYPE_CHECKING:
    from lab.rig import Rig
    from lab.simulate import Motion

MAX_CHANNELS = 6
"""Outputs shown: those with the largest error of the calibrated model."""
COLORS = {
    "measured": SERIES[7],
    "nominal": SERIES[1],
    "calibrated": SERIES[4],
    "extended": SERIES[0],
}
PLAIN = rr.MediaType.MARKDOWN


def write_diagnosis_rrd(
    path: str | Path,
    diagnosis: Diagnosis,
    recording: Diagnosed,
    *,
    motions: tuple[Motion, Motion] | None = None,
) -> None:
    """Writes one .rrd file with its layout saved in it.

    Args:
        path: file to come.
        diagnosis: what was found.
        recording: what it was found in, with the channels of the diagnosis; long records are drawn as envelopes.
        motions: of the structure as given and extended, from the start of the first record.
    """
    title = title_of(diagnosis, recording)
    # The viewer keeps one layout per application, so each diagnosis is an application of its own.
    application = "modal lab " + re.sub(r"[^A-Za-z0-9]+", "-", title)
    stream = rr.RecordingStream(application, recording_id=uuid.uuid4())
    try:
        stream.save(path)
        stream.send_recording_name(title)
        text = _summary(title, diagnosis, recording)
        stream.log("summary", rr.TextDocument(text, media_type=PLAIN), static=True)
        models = shown_models(diagnosis)
        summary = rrb.TextDocumentView(origin="/summary", name="Summary")
        if diagnosis.spectra is not None:
            plots = log_spectra(stream, diagnosis.spectra, worst_rows(diagnosis.spectra), models)
            tab = rrb.Horizontal(summary, rrb.Vertical(*plots), column_shares=[2, 3], name="Spectra")
            stream.send_blueprint(rrb.Blueprint(rrb.Tabs(tab), rrb.TimePanel(state="hidden")))
            return
        errors = relative_errors(diagnosis, "calibrated")
        rows = sorted(int(row) for row in np.argsort(-errors, kind="stable")[:MAX_CHANNELS])
        predicted = [
            _log_lines(
                stream,
                join("/predictions", recording.outputs[row].name),
                recording,
                row,
                {
                    name: [getattr(p, name)[row] for p in diagnosis.predictions]
                    for name in ("measured", *models)
                },
            )
            for row in rows
        ]
        left = [
            _log_lines(
                stream,
                join("/residuals", recording.outputs[row].name),
                recording,
                row,
                {name: [residual(p, name)[row] for p in diagnosis.predictions] for name in models},
            )
            for row in rows
        ]
        tabs: list[rrb.Container] = [
            rrb.Horizontal(
                summary, rrb.Vertical(*predicted), column_shares=[2, 3], name="Measured and predicted"
            ),
            rrb.Vertical(*left, name="Residuals"),
        ]
        restoring = restoring_force(diagnosis, recording)
        if restoring is not None:
            tabs.append(rrb.Vertical(log_restoring(stream, restoring), name="Restoring force"))
        if motions is not None:
            tabs.append(rrb.Horizontal(*_log_structures(stream, diagnosis, motions), name="Structure"))
        stream.send_blueprint(
            rrb.Blueprint(
                rrb.Tabs(*tabs),
                rrb.BlueprintPanel(state="collapsed"),
                rrb.SelectionPanel(state="collapsed"),
                rrb.TimePanel(state="collapsed", timeline=TIMELINE),
            )
        )
    finally:
        stream.disconnect()


def _log_lines(
    stream: rr.RecordingStream, origin: str, recording: Recording, row: int, lines: dict[str, list[Array]]
) -> rrb.View:
    """Logs signals of one channel as one line each, records one after the other; one view."""
    channel, rate = recording.outputs[row], recording.sample_rate
    start = 0.0
    times: list[Array] = []
    values: list[Array] = []
    for parts in zip(*lines.values(), strict=True):
        together = envelope(Record("other", np.zeros((0, 0)), np.stack(parts)), rate)
        if times and together.time.size:
            # A gap between records, so that no line joins them.
            times.append(np.array([start - 1e-9]))
            values.append(np.full((len(parts), 1), np.nan))
        times.append(start + together.time)
        values.append(together.outputs)
        start += parts[0].size / rate
    names = list(lines)
    style = rr.SeriesLines(
        names=names,
        colors=[rgb(COLORS[name]) for name in names],
        widths=[2.0 if name == "measured" else 1.0 for name in names],
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    stream.log(origin, style, static=True)
    stream.send_columns(
        origin,
        [rr.TimeColumn(TIMELINE, duration=np.concatenate(times))],
        rr.Scalars.columns(scalars=np.ascontiguousarray(np.concatenate(values, axis=1).T)),
    )
    ends = (rr.TimeRangeBoundary.absolute(seconds=t) for t in (0.0, start))
    whole = rrb.TimeAxis(view_range=rr.TimeRange(*ends))
    return rrb.TimeSeriesView(
        origin=origin,
        name=f"{channel.name} [{channel.unit}]",
        plot_legend=rrb.PlotLegend(corner="RightTop"),
        axis_x=whole,
    )


def _log_structures(
    stream: rr.RecordingStream, diagnosis: Diagnosis, motions: tuple[Motion, Motion]
) -> list[rrb.View]:
    """The structure as given and extended under the recorded forces, both enlarged alike."""
    rigs = (diagnosis.nominal, diagnosis.extended)
    highest = diagnosis.nominal.second_order().modes().frequency_hz
    factor = min(
        structure.magnification(rig, motion.position) for rig, motion in zip(rigs, motions, strict=True)
    )
    return [
        _log_structure(stream, name, rig, motion, motion_frames(motion, highest), factor)
        for name, rig, motion in zip(("nominal", "extended"), rigs, motions, strict=True)
    ]


def _log_structure(
    stream: rr.RecordingStream, name: str, rig: Rig, motion: Motion, shown: np.ndarray, factor: float
) -> rrb.View:
    origin = f"/structure/{name}"
    frames = structure.frames(rig, factor * motion.position[:, shown])
    log_solids(stream, origin, rig, named=len(rig.bodies) <= MAX_NAMED)
    log_frames(stream, origin, rig, frames, [rr.TimeColumn(TIMELINE, duration=motion.time[shown])])
    return view(origin, f"{name}, motion × {factor:g}", rig, frames, aspect=1.0)


def _summary(title: str, diagnosis: Diagnosis, recording: Recording) -> str:
    """Verdict, findings, errors and calibration in Markdown."""
    lines = [f"# {plain(title)}", "", plain(verdict_of(diagnosis, recording).sentence)]
    for name, table in (
        ("Findings", finding_table(diagnosis)),
        ("Errors on data kept aside", error_table(diagnosis)),
        ("Calibration", calibration_table(diagnosis)),
    ):
        if table.rows:
            lines += ["", f"## {name}", "", _row(table.heads), "|" + "---|" * len(table.heads)]
            lines += [_row(row) for row in table.rows]
    lines += ["", *[f"- {plain(warning)}" for warning in diagnosis.warnings]]
    return "\n".join(lines)


def _row(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(plain(cell) for cell in cells) + " |"
