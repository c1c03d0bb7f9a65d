"""A result as one Rerun recording that opens laid out. The only place that imports rerun.

One file per thing shown: `scene`, `channels` and `spectra` make the Test tab, `modes`, `stabilization` and the
MAC of `matrices` the Modes tab, M, C, K of `matrices` the third. Each logs its entities and returns the views
that show them.
"""

from __future__ import annotations

import re
import uuid
from pathlib import Path
from typing import TYPE_CHECKING

import rerun as rr
import rerun.blueprint as rrb

from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.result import Result
from lab.show.rerun_log.channels import log_channels
from lab.show.rerun_log.matrices import log_mac, log_matrices
from lab.show.rerun_log.modes import MODES_SHARE, grid_columns, log_modes
from lab.show.rerun_log.plot import plain
from lab.show.rerun_log.responses import log_responses
from lab.show.rerun_log.scene import log_motion, motion_frames, time_panel
from lab.show.rerun_log.spectra import log_channel_spectra
from lab.show.rerun_log.stabilization import log_stabilization
from lab.show.response_spectra import drawable, response_spectra
from lab.show.signals import Spectra, spectra
from lab.show.tables import validation_rows
from lab.show.verdict import mode_rows, verdict

if TYPE_CHECKING:
    from lab.rig import Rig
    from lab.simulate import Motion

MAX_SERIES = 6
"""Time-series views stacked before they get too thin to read."""
MAX_LINES = 2
"""Spectra and coherence shown at least."""


def write_rrd(
    path: str | Path,
    result: Result,
    recording: Recording | FrequencyResponse,
    *,
    rig: Rig | None = None,
    motion: Motion | None = None,
) -> None:
    """Writes one .rrd file with its layout saved in it.

    Args:
        path: file to come.
        result: what was identified.
        recording: what it was identified from; long records are drawn as minimum and maximum envelopes.
        rig: the structure, to be drawn in three dimensions.
        motion: how it moved, starting with the first record.
    """
    title = result.title or "untitled"
    # The viewer keeps one layout per application, so each test is an application of its own.
    application = "modal lab " + re.sub(r"[^A-Za-z0-9]+", "-", title)
    stream = rr.RecordingStream(application, recording_id=uuid.uuid4())
    try:
        stream.save(path)
        stream.send_recording_name(title)
        stream.log(
            "summary", rr.TextDocument(_summary(title, result), media_type=rr.MediaType.MARKDOWN), static=True
        )
        shown = (
            motion_frames(motion, result.modes.frequency_hz)
            if rig is not None and motion is not None
            else None
        )
        end = float(motion.time[shown[-1]]) if motion is not None and shown is not None else 0.0
        scene = log_motion(stream, rig, motion, shown) if rig is not None and motion is not None else []
        if isinstance(recording, FrequencyResponse):
            result = drawable(result, recording)
            spectrum: Spectra | None = response_spectra(recording)
            series: list[rrb.View] = []
            lines = log_responses(stream, result, recording)
        else:
            spectrum = spectra(recording)
            series = log_channels(stream, recording)
            lines = log_channel_spectra(stream, recording, spectrum, result.modes.frequency_hz)
        tabs = [
            _test_tab(scene, series, lines),
            _modes_tab(
                log_modes(stream, result, rig, end),
                log_stabilization(stream, result, spectrum),
                log_mac(stream, result),
            ),
            _matrices_tab(log_matrices(stream, result), result),
        ]
        stream.send_blueprint(
            rrb.Blueprint(
                rrb.Tabs(*[tab for tab in tabs if tab is not None]),
                rrb.BlueprintPanel(state="collapsed"),
                rrb.SelectionPanel(state="collapsed"),
                time_panel(result.modes.frequency_hz, end),
            )
        )
    finally:
        stream.disconnect()


def _test_tab(scene: list[rrb.View], series: list[rrb.View], lines: list[rrb.View]) -> rrb.Container:
    """The structure above the summary; beside them channels over time, and below these over frequency."""
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    left = rrb.Vertical(*scene, summary, row_shares=[3] * len(scene) + [2]) if scene else summary
    right = [*series[:MAX_SERIES], *lines[: max(MAX_LINES, MAX_SERIES - len(series))]]
    return rrb.Horizontal(left, rrb.Vertical(*right), column_shares=[2, 3], name="Test")


def _modes_tab(
    views: list[rrb.View], stabilization: list[rrb.View], agreement: list[rrb.View]
) -> rrb.Container | None:
    """The modes in a grid; beside them the stabilization diagram, the MAC and the key to numbers of channels."""
    keys = [view for view in views if isinstance(view, rrb.TextDocumentView)]
    modes = [view for view in views if view not in keys]
    beside: list[rrb.View | rrb.Container] = [*stabilization]
    if agreement:
        beside.append(rrb.Tabs(*agreement))
    beside += keys
    if not modes and not beside:
        return None
    parts: list[rrb.Container] = []
    if modes:
        parts.append(rrb.Grid(*modes, grid_columns=grid_columns(len(modes))))
    if beside:
        shares = [4] * len(stabilization) + [4] * bool(agreement) + [1] * len(keys)
        parts.append(rrb.Vertical(*beside, row_shares=shares))
    widths = [MODES_SHARE, 1 - MODES_SHARE] if len(parts) == 2 else [1]
    return rrb.Horizontal(*parts, column_shares=widths, name="Modes")


def _matrices_tab(views: list[rrb.View], result: Result) -> rrb.Container | None:
    """All nine at once while their numbers fit, else M, C and K behind tabs of their own."""
    if len(views) < 9:
        return _grid("Matrices", views, len(views))
    if result.second_order is not None and len(result.second_order.dofs) <= 4:
        return _grid("Matrices", views, 3)
    rows = [rrb.Horizontal(*views[i : i + 3], name=letter) for i, letter in ((0, "M"), (3, "C"), (6, "K"))]
    return rrb.Tabs(*rows, name="Matrices")


def _grid(name: str, views: list[rrb.View], columns: int) -> rrb.Container | None:
    return rrb.Grid(*views, grid_columns=min(columns, len(views)), name=name) if views else None


def _summary(title: str, result: Result) -> str:
    """Verdict and modes in Markdown."""
    lines = [f"# {plain(title)}", "", plain(verdict(result).sentence), ""]
    compared = result.comparison is not None
    if len(result.modes):
        lines += ["| Mode | Frequency [Hz] | Damping [%] |" + " Error in frequency | MAC |" * compared]
        lines += ["|---:|---:|---:|" + "---:|---:|" * compared]
    for row in mode_rows(result):
        if row.frequency is None or row.damping is None:
            lines.append(f"| missed | ({row.true_frequency:.5g}) | | | |")
            continue
        error = "" if row.frequency_error is None else f"{row.frequency_error:.1e}"
        agreement = "" if row.mac is None else f"{row.mac:.4f}"
        own = f"| {row.number} | {row.frequency:.5g} | {100 * row.damping:.4g} |"
        lines.append(own + f" {error} | {agreement} |" * compared)
    if result.validation:
        lines += ["", "| Criterion of the field | Required | Reached | Outcome |", "|---|---:|---:|---|"]
        lines += [
            f"| {plain(row.name)} | {row.bound} | {row.value} | {row.outcome} |"
            for row in validation_rows(result)
        ]
    lines += ["", *[f"- {plain(warning)}" for warning in result.warnings]]
    return "\n".join(lines)
