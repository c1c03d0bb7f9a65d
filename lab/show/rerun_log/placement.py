"""A placement: the structure at rest with the chosen sensors and actuators as arrows, and the layouts compared."""

from __future__ import annotations

import re
import uuid
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from lab.placement.outcome import Placement
from lab.show import structure
from lab.show.drawing import SERIES, rgb
from lab.show.findings import Table
from lab.show.marks import Mark, actuator_marks, sensor_marks
from lab.show.placements import cause_table, drive_table, ranking_table, verdict_of
from lab.show.rerun_log.plot import plain
from lab.show.rerun_log.scene import MAX_NAMED, TIMELINE, join, log_frames, log_solids, view

if TYPE_CHECKING:
    from lab.rig import Rig

COLORS = {"sensors": SERIES[0], "actuators": SERIES[1]}
MAX_CAUSES = 30


def write_placement_rrd(path: str | Path, placement: Placement, rig: Rig) -> None:
    """Writes one .rrd file with its layout saved in it.

    Args:
        path: file to come.
        placement: what was chosen.
        rig: the structure, with every candidate connected.
    """
    title = f"{placement.model}: placement for {placement.target}"
    # The viewer keeps one layout per application, so each placement is an application of its own.
    application = "modal lab " + re.sub(r"[^A-Za-z0-9]+", "-", title)
    stream = rr.RecordingStream(application, recording_id=uuid.uuid4())
    try:
        stream.save(path)
        stream.send_recording_name(title)
        text = _summary(title, placement)
        stream.log("summary", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
        frames = structure.frames(rig, np.zeros((rig.model.nv, 1)))
        origin = "/placement/structure"
        log_solids(stream, origin, rig, named=len(rig.bodies) <= MAX_NAMED)
        log_frames(stream, origin, rig, frames, [rr.TimeColumn(TIMELINE, duration=[0.0])])
        reach = 0.35 * structure.spacing(rig)
        _log_marks(stream, origin, "sensors", sensor_marks(rig, placement.sensors), reach)
        _log_marks(stream, origin, "actuators", actuator_marks(rig, placement.actuators), reach)
        scene = view(origin, f"{rig.name}: sensors blue, actuators orange", rig, frames, aspect=1.2)
        summary = rrb.TextDocumentView(origin="/summary", name="Summary")
        stream.send_blueprint(
            rrb.Blueprint(
                rrb.Horizontal(scene, summary, column_shares=[3, 2]),
                rrb.BlueprintPanel(state="collapsed"),
                rrb.SelectionPanel(state="collapsed"),
                rrb.TimePanel(state="hidden"),
            )
        )
    finally:
        stream.disconnect()


def _log_marks(stream: rr.RecordingStream, origin: str, kind: str, marks: list[Mark], reach: float) -> None:
    """Logs channels as arrows with their names, once."""
    for mark in marks:
        # An actuator pushes towards its place, a sensor reads away from it.
        start = mark.point if kind == "sensors" else mark.point - reach * mark.direction
        arrow = rr.Arrows3D(
            origins=[start],
            vectors=[reach * mark.direction],
            radii=0.06 * reach,
            colors=[rgb(COLORS[kind])],
            labels=[mark.name],
        )
        stream.log(join(origin, kind, mark.name), arrow, static=True)


def _summary(title: str, placement: Placement) -> str:
    """Verdict and tables in Markdown."""
    causes = cause_table(placement)
    lines = [f"# {plain(title)}", "", plain(verdict_of(placement).sentence), ""]
    lines += [f"- sensors: {plain(', '.join(placement.sensors))}"]
    lines += [f"- actuators: {plain(', '.join(placement.actuators))}", ""]
    for table in (
        ranking_table(placement),
        drive_table(placement),
        Table(causes.heads, causes.rows[:MAX_CAUSES]),
    ):
        if table.rows:
            lines += ["| " + " | ".join(table.heads) + " |", "|" + "---|" * len(table.heads)]
            lines += ["| " + " | ".join(plain(cell) for cell in row) + " |" for row in table.rows] + [""]
    lines += [f"- {plain(warning)}" for warning in placement.warnings]
    return "\n".join(lines)
