"""A structure in three dimensions: solids logged once, their motion, springs and forces in columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from lab.show import structure
from lab.show.camera import eye
from lab.show.drawing import SERIES, diverging, rgb
from lab.show.springs import drawn_springs, ground_ends

if TYPE_CHECKING:
    from lab.rig import Rig
    from lab.simulate import Motion

TIMELINE = "sim_time"
N_FRAMES = 600
"""Frames of the moving structure."""
MAX_NAMED = 20
"""Structures of up to so many bodies carry their names."""
GROUND = (110, 110, 110)


def motion_frames(motion: Motion, frequency_hz: np.ndarray) -> np.ndarray:
    """Samples to draw: a dozen per period of the highest mode, from the start, at most `N_FRAMES`."""
    n = motion.time.size
    dt = float(motion.time[1] - motion.time[0]) if n > 1 else 1.0
    highest = float(np.max(frequency_hz, initial=0.0))
    every = max(1, int(1 / (12 * highest * dt))) if highest > 0 else -(-n // N_FRAMES)
    return np.arange(0, n, every)[:N_FRAMES]


def log_motion(
    stream: rr.RecordingStream, rig: Rig, motion: Motion, shown: np.ndarray | None
) -> list[rrb.View]:
    """Logs the structure as it moved in the test, forces as arrows; one view."""
    if shown is None or not shown.size:
        return []
    origin = "/test/structure"
    position = motion.position[:, shown]
    factor = structure.magnification(rig, position)
    frames = structure.frames(rig, factor * position)
    log_solids(stream, origin, rig, named=len(rig.bodies) <= MAX_NAMED)
    time = [rr.TimeColumn(TIMELINE, duration=motion.time[shown])]
    log_frames(stream, origin, rig, frames, time)
    _log_forces(stream, origin, rig, frames, motion.inputs[:, shown], time)
    return [
        view(
            origin,
            f"{rig.name}, motion × {factor:g}, springs blue in compression, red in tension",
            rig,
            frames,
            aspect=1.2,
        )
    ]


def time_panel(frequency_hz: np.ndarray, end: float) -> rrb.TimePanel:
    """The lowest mode swings about once in two seconds; the `end` seconds of moving pictures run in a loop."""
    if end <= 0:
        return rrb.TimePanel(state="collapsed", timeline=TIMELINE)
    lowest = float(np.min(frequency_hz)) if frequency_hz.size else 0.5
    return rrb.TimePanel(
        state="collapsed",
        timeline=TIMELINE,
        playback_speed=float(f"{0.5 / lowest:.1g}") if lowest > 0 else 1.0,
        loop_mode="selection",
        time_selection=rrb.components.AbsoluteTimeRange(0, round(1e9 * end)),
        play_state="playing",
    )


def view(origin: str, name: str, rig: Rig, frames: structure.Frames, *, aspect: float) -> rrb.View:
    """A 3D view from the front, a little from above, far enough to see all in a window of that aspect."""
    points = np.concatenate([frames.position.reshape(-1, 3), *[path.reshape(-1, 3) for path in frames.paths]])
    position, target = eye(points, aspect=aspect, margin=structure.reach(rig))
    controls = rrb.EyeControls3D(position=position, look_target=target)
    return rrb.Spatial3DView(origin=origin, name=name, line_grid=False, eye_controls=controls)


def log_solids(stream: rr.RecordingStream, origin: str, rig: Rig, *, named: bool) -> None:
    """Logs the geometry and the ground ends of springs, once."""
    stream.log(origin, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for number, solid in enumerate(structure.solids(rig)):
        body = rig.model.body(solid.body).name
        label = [body] if named and body and solid.body else None
        stream.log(f"{_body(origin, rig, solid.body)}/solid{number}", *_archetypes(solid, label), static=True)
    feet = ground_ends(rig, structure.spacing(rig))
    if len(feet):
        half = np.full((len(feet), 3), 0.03 * structure.spacing(rig))
        boxes = rr.Boxes3D(centers=feet, half_sizes=half, colors=GROUND, fill_mode="solid")
        stream.log(f"{origin}/ground", boxes, static=True)


def log_frames(
    stream: rr.RecordingStream,
    origin: str,
    rig: Rig,
    frames: structure.Frames,
    time: Sequence[rr.TimeColumn],
    *,
    limit: float | None = None,
) -> None:
    """Logs where bodies are and how springs stretch, one row per frame; `limit` is the extension in full colour."""
    for body, place, turn in zip(
        structure.moving_bodies(rig), frames.position, frames.quaternion, strict=True
    ):
        stream.send_columns(
            _body(origin, rig, body), time, rr.Transform3D.columns(translation=place, quaternion=turn)
        )
    largest = float(np.max(np.abs(frames.extension), initial=0.0)) if limit is None else limit
    radius = 0.01 * structure.spacing(rig)
    for row, path, extension in zip(drawn_springs(rig), frames.paths, frames.extension, strict=True):
        entity = join(origin, "springs", rig.springs[row].name)
        stream.log(entity, rr.LineStrips3D.from_fields(radii=radius), static=True)
        colors = diverging(extension, largest)
        stream.send_columns(entity, time, rr.LineStrips3D.columns(strips=path, colors=colors))


def _log_forces(
    stream: rr.RecordingStream,
    origin: str,
    rig: Rig,
    frames: structure.Frames,
    inputs: np.ndarray,
    time: Sequence[rr.TimeColumn],
) -> None:
    """Logs each input as an arrow on its body, the largest about as long as the bodies are apart."""
    rows = structure.driven_inputs(rig)
    largest = float(np.max(np.abs(inputs[rows]), initial=0.0))
    if not rows or largest == 0:
        return
    length = 0.7 * structure.spacing(rig) / largest
    for row, start, direction in zip(rows, frames.force_origin, frames.force_direction, strict=True):
        channel = rig.inputs[row]
        vectors = direction * (length * np.sign(channel.factor) * inputs[row])[:, None]
        entity = join(origin, "forces", channel.name)
        style = rr.Arrows3D.from_fields(radii=0.03 * structure.spacing(rig), colors=rgb(SERIES[4]))
        stream.log(entity, style, static=True)
        stream.send_columns(entity, time, rr.Arrows3D.columns(vectors=vectors, origins=start))


def _body(origin: str, rig: Rig, body: int) -> str:
    """Entity of a body, named so that no body can collide with springs or forces."""
    return join(origin, "bodies", rig.model.body(body).name or f"body{body}")


def join(origin: str, *parts: str) -> str:
    """Entity path under `origin`, with names from outside escaped."""
    return f"{origin}/{rr.new_entity_path(list(parts)).lstrip('/')}"


def _archetypes(solid: structure.Solid, label: list[str] | None) -> list[rr.AsComponents]:
    """The solid as Rerun draws it."""
    size, place = solid.size, [solid.position]
    color = [solid.color] if solid.body else [GROUND]
    look: dict[str, Any] = {
        "quaternions": [solid.quaternion],
        "colors": color,
        "fill_mode": "solid",
        "labels": label,
    }
    if solid.kind == "box":
        return [rr.Boxes3D(half_sizes=[size], centers=place, **look)]
    if solid.kind == "ellipsoid":
        return [rr.Ellipsoids3D(half_sizes=[size], centers=place, **look)]
    if solid.kind == "cylinder":
        return [rr.Cylinders3D(lengths=[2 * size[1]], radii=[size[0]], centers=place, **look)]
    if solid.kind == "capsule":
        # Rerun's capsule starts at its origin and points along z; MuJoCo's is centred.
        start = solid.position - size[1] * _z_axis(solid.quaternion)
        return [rr.Capsules3D(lengths=[2 * size[1]], radii=[size[0]], translations=[start], **look)]
    mesh = rr.Mesh3D(vertex_positions=solid.vertices, triangle_indices=solid.faces, albedo_factor=color[0])
    return [mesh, rr.InstancePoses3D(translations=place, quaternions=[solid.quaternion])]


def _z_axis(quaternion: np.ndarray) -> np.ndarray:
    """Where a rotation (x, y, z, w) takes the z axis."""
    x, y, z, w = quaternion
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
