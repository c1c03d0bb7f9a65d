"""Modes: each one swinging in place where the structure is known, else its shape over the channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from lab.result import Result
from lab.shapes import aligned, displacement_shapes, dof_shapes
from lab.show import structure
from lab.show.drawing import SERIES, Axes, rgb
from lab.show.rerun_log.plot import AXIS, log_axes, plain, plot_view
from lab.show.rerun_log.scene import TIMELINE, log_frames, log_solids, view
from lab.show.shapes import shown_modes

if TYPE_CHECKING:
    from lab.rig import Rig

PHASE = "phase_deg"
PER_LOOP = 24
"""Frames of one cycle."""
MAX_MODES = 12
"""Modes shown side by side."""
MAX_LOOPS = 40
MAX_NAMED = 6
"""Shapes over up to so many channels carry their names."""
MODES_SHARE = 0.6
"""Of the width of the window."""
WINDOW = (1600.0, 900.0)
"""Width and height that the layout is made for."""
TITLE = 30.0
"""Height of the line above a view."""


def grid_columns(n_modes: int) -> int:
    """Modes side by side, so that each view is wider than high."""
    return 1 if n_modes <= 3 else 2 if n_modes <= 8 else 3


def log_modes(stream: rr.RecordingStream, result: Result, rig: Rig | None, end: float) -> list[rrb.View]:
    """Logs the modes, at most `MAX_MODES` of them; one view each.

    Args:
        stream: where to.
        result: with the modes.
        rig: the structure, or None to plot shapes over channels.
        end: time [s] up to which the modes keep swinging on the time line of the test.
    """
    shown = shown_modes(result, MAX_MODES)
    if rig is not None:
        shapes, known = dof_shapes(result, rig.dofs)
        if known.any():
            return [_log_swing(stream, result, rig, shapes[:, i], known[:, i], i, end) for i in shown]
    rows, shapes = displacement_shapes(result.modes)
    if not rows or not shown:
        return []
    names = [result.modes.outputs[row].name for row in rows]
    return [
        *[_log_shape(stream, result, aligned(shapes)[:, i], names, i) for i in shown],
        _log_names(stream, names),
    ]


def _name(result: Result, i: int) -> str:
    """Frequency and damping with their standard deviations, where known."""
    modes = result.modes
    f, z = f"{modes.frequency_hz[i]:.4g}", f"{100 * modes.damping_ratio[i]:.3g}"
    f += _error_bar(modes.frequency_std, i)
    z += _error_bar(modes.damping_std, i, 100.0)
    return f"{i + 1}: {f} Hz, ζ {z} %" + ("" if result.stable[i] else ", not stable")


def _error_bar(std: np.ndarray | None, i: int, scale: float = 1.0) -> str:
    """One standard deviation, where there is one."""
    return "" if std is None or not std[i] > 0 else f"±{scale * std[i]:.1g}"


def _log_swing(
    stream: rr.RecordingStream,
    result: Result,
    rig: Rig,
    shape: np.ndarray,
    known: np.ndarray,
    i: int,
    end: float,
) -> rrb.View:
    """The mode once around on the phase line, and over and over on the time line as fast as the lowest."""
    origin = f"/modes/mode{i + 1}"
    angle = 2 * np.pi * np.arange(PER_LOOP) / PER_LOOP
    position = np.real(shape[:, None] * np.exp(1j * angle))  # (n_dofs, n_frames)
    loop = structure.frames(rig, structure.swing(rig, position) * position)
    log_solids(stream, origin, rig, named=False)
    period = 1 / float(np.min(result.modes.frequency_hz))
    n_loops = min(MAX_LOOPS, max(1, int(np.ceil(end / period))))
    time = np.arange(n_loops * PER_LOOP) * (period / PER_LOOP)
    log_frames(stream, origin, rig, loop.repeated(n_loops), [rr.TimeColumn(TIMELINE, duration=time)])
    log_frames(
        stream, origin, rig, loop, [rr.TimeColumn(PHASE, sequence=np.arange(PER_LOOP) * 360 // PER_LOOP)]
    )
    seen = "" if known.all() else f" ({int(known.sum())} of {known.size} degrees of freedom known)"
    return view(origin, _name(result, i) + seen, rig, loop, aspect=_aspect(len(result.modes)))


def _aspect(n_modes: int) -> float:
    """Width over height of a view among so many."""
    n = min(n_modes, MAX_MODES)
    columns = grid_columns(n)
    rows = -(-n // columns)
    return (MODES_SHARE * WINDOW[0] / columns) / (WINDOW[1] / rows - TITLE)


def _log_shape(
    stream: rr.RecordingStream, result: Result, shape: np.ndarray, names: list[str], i: int
) -> rrb.View:
    """Displacement at each channel: the real part as a stem, the imaginary part as a mark."""
    origin = f"/modes/mode{i + 1}"
    number = np.arange(1, shape.size + 1)
    axes = Axes((0.5, shape.size + 0.5), (-1.1, 1.1), 120.0, 60.0)
    log_axes(stream, origin, axes)
    real, imaginary, zero = (axes.at(number, part) for part in (shape.real, shape.imag, np.zeros(shape.size)))
    stream.log(
        f"{origin}/zero", rr.LineStrips2D([axes.at(axes.x, (0.0, 0.0))], colors=AXIS, radii=-0.5), static=True
    )
    stems = [np.array([a, b]) for a, b in zip(zero, real, strict=True)]
    stream.log(f"{origin}/stems", rr.LineStrips2D(stems, colors=rgb(SERIES[5]), radii=0.6), static=True)
    labels = names if shape.size <= MAX_NAMED else None
    marks = rr.Points2D(real, colors=rgb(SERIES[5]), radii=1.2, labels=labels, show_labels=labels is not None)
    stream.log(f"{origin}/real", marks, static=True)
    stream.log(f"{origin}/imaginary", rr.Points2D(imaginary, colors=rgb(SERIES[4]), radii=0.8), static=True)
    return plot_view(origin, _name(result, i), axes)


def _log_names(stream: rr.RecordingStream, names: list[str]) -> rrb.View:
    """What the numbers under the shapes stand for."""
    listed = ", ".join(f"{number}: {plain(name)}" for number, name in enumerate(names, start=1))
    text = f"Displacement at each channel, the largest 1. Orange: imaginary part. {listed}."
    stream.log("/modes/channels", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
    return rrb.TextDocumentView(origin="/modes/channels", name="Channels")
