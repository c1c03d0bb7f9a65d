"""The structure as given and with the findings, under the same forces, and marks where the findings sit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from lab.diagnosis.outcome import Diagnosis, Finding
from lab.show import structure
from lab.show.findings import words
from lab.show.places import arcs, places
from lab.show.rerun_log.scene import (
    MAX_NAMED,
    TIMELINE,
    join,
    log_frames,
    log_solids,
    motion_frames,
    view,
)

if TYPE_CHECKING:
    from lab.simulate import Motion

MARK = (255, 210, 0)
NAMES = {"nominal": "Model as given", "extended": "With the findings"}
ASPECT = 1.1


def log_structures(
    stream: rr.RecordingStream, diagnosis: Diagnosis, motions: tuple[Motion, Motion]
) -> list[rrb.View]:
    """Logs both structures moving, enlarged alike, a yellow mark where every finding sits in each; two views."""
    rigs = (diagnosis.nominal, diagnosis.extended)
    highest = diagnosis.nominal.second_order().modes().frequency_hz
    factor = min(
        structure.magnification(rig, motion.position) for rig, motion in zip(rigs, motions, strict=True)
    )
    positions = [factor * motion.position[:, motion_frames(motion, highest)] for motion in motions]
    moved = [structure.frames(rig, q) for rig, q in zip(rigs, positions, strict=True)]
    # Both in the same colours, so that a spring that stretches more looks it.
    limit = max(float(np.max(np.abs(frames.extension), initial=0.0)) for frames in moved)
    views = []
    for name, rig, motion, q, frames in zip(NAMES, rigs, motions, positions, moved, strict=True):
        origin = f"/structure/{name}"
        time = [rr.TimeColumn(TIMELINE, duration=motion.time[motion_frames(motion, highest)])]
        log_solids(stream, origin, rig, named=len(rig.bodies) <= MAX_NAMED)
        log_frames(stream, origin, rig, frames, time, limit=limit)
        for number, finding in enumerate(diagnosis.findings):
            where = places(rig, finding.effect.location, q)
            entity = join(origin, "findings", str(number))
            _log_mark(stream, entity, finding, where, structure.spacing(rig), time, level=number)
        marked = ", yellow where a finding sits" if diagnosis.findings else ""
        views.append(view(origin, f"{NAMES[name]}, motion × {factor:g}{marked}", rig, frames, aspect=ASPECT))
    return views


def _log_mark(
    stream: rr.RecordingStream,
    entity: str,
    finding: Finding,
    where: np.ndarray,
    spacing: float,
    time: list[rr.TimeColumn],
    *,
    level: int,
) -> None:
    """A ball around a point or an arc from end to end, and `level` steps above it the cause; nothing without a place."""
    if where.shape[1] == 2:
        lines = arcs(where, 0.5 * spacing)
        stream.log(entity, rr.LineStrips3D.from_fields(radii=0.02 * spacing, colors=MARK), static=True)
        stream.send_columns(entity, time, rr.LineStrips3D.columns(strips=lines))
        top = lines[:, 8]
    elif where.shape[1] == 1:
        size = [[0.3 * spacing] * 3]
        ball = rr.Ellipsoids3D.from_fields(half_sizes=size, colors=MARK, fill_mode="majorwireframe")
        stream.log(entity, ball, static=True)
        stream.send_columns(entity, time, rr.Ellipsoids3D.columns(centers=where[:, 0]))
        top = where[:, 0] + np.array([0.0, 0.0, 0.3 * spacing])
    else:
        return
    label = words(finding.effect.cause)
    text = rr.Points3D.from_fields(colors=MARK, radii=1e-6, labels=[label], show_labels=True)
    stream.log(f"{entity}/label", text, static=True)
    # The viewer writes a label a little below its point.
    above = top + np.array([0.0, 0.0, (0.35 + 0.4 * level) * spacing])
    stream.send_columns(f"{entity}/label", time, rr.Points3D.columns(positions=above))
