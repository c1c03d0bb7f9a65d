"""A diagnosis: what it says and where, measured against predictions, and what each model leaves."""

from __future__ import annotations

import re
import uuid
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from identification.recording import Recording
from lab.diagnosis.outcome import UNEXPLAINED, Diagnosis
from lab.diagnosis.restoring import restoring_force
from lab.show.diagnosed import Diagnosed, title_of
from lab.show.findings import calibration_table, error_table, finding_table, where
from lab.show.headline import headline
from lab.show.rerun_log.leftovers import (
    log_over_amplitude,
    log_over_frequency,
    log_over_time,
    log_predictions,
)
from lab.show.rerun_log.plot import plain
from lab.show.rerun_log.ranking import log_ranking
from lab.show.rerun_log.restoring import log_restoring
from lab.show.rerun_log.scene import time_panel
from lab.show.rerun_log.side_by_side import log_structures
from lab.show.rerun_log.spectra import log_spectra
from lab.show.residuals import leftover, relative_errors, shown_models, worst_rows

if TYPE_CHECKING:
    from lab.simulate import Motion

MAX_CHANNELS = 6
"""Outputs predicted: those with the largest error of the calibrated model."""
MAX_RESIDUALS = 3
"""Outputs whose residual is drawn over time, frequency and amplitude."""


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
        stream.log("summary", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
        ranking = log_ranking(stream, diagnosis)
        summary = rrb.TextDocumentView(origin="/summary", name="Summary")
        left = rrb.Vertical(summary, *ranking, row_shares=[3] + [2] * len(ranking))
        if diagnosis.spectra is not None:
            rows = worst_rows(diagnosis.spectra)
            plots = log_spectra(stream, diagnosis.spectra, rows, shown_models(diagnosis))
            tab = rrb.Horizontal(left, rrb.Vertical(*plots), column_shares=[2, 3], name="Diagnosis")
            stream.send_blueprint(rrb.Blueprint(rrb.Tabs(tab), rrb.TimePanel(state="hidden")))
            return
        assert isinstance(recording, Recording)  # responses are spectra, shown above
        worst = np.argsort(-relative_errors(diagnosis, "calibrated"), kind="stable")
        rows = sorted(int(row) for row in worst[:MAX_CHANNELS])
        few = sorted(int(row) for row in worst[:MAX_RESIDUALS])
        predicted = dict(zip(rows, log_predictions(stream, diagnosis, recording, rows), strict=True))
        structures = [] if motions is None else log_structures(stream, diagnosis, motions)
        n_first = 2 if structures else 4
        first = [predicted.pop(int(row)) for row in worst[:n_first]]
        tabs: list[rrb.Container] = [_first_tab(left, structures, first)]
        if predicted:
            tabs.append(rrb.Vertical(*predicted.values(), name="Further outputs"))
        tabs.append(_residual_tab(stream, diagnosis, recording, few))
        restoring = restoring_force(diagnosis, recording)
        if restoring is not None:
            tabs.append(rrb.Vertical(log_restoring(stream, restoring), name="Restoring force"))
        lowest = diagnosis.nominal.second_order().modes().frequency_hz
        end = 0.0 if motions is None else float(motions[0].time[-1])
        stream.send_blueprint(
            rrb.Blueprint(
                rrb.Tabs(*tabs),
                rrb.BlueprintPanel(state="collapsed"),
                rrb.SelectionPanel(state="collapsed"),
                time_panel(lowest, end),
            )
        )
    finally:
        stream.disconnect()


def _first_tab(left: rrb.Container, structures: list[rrb.View], predicted: list[rrb.View]) -> rrb.Container:
    """Words and causes; beside them both structures, and below these the outputs missed most."""
    parts: list[rrb.View | rrb.Container] = [*predicted]
    if structures:
        parts.insert(0, rrb.Horizontal(*structures))
    shares = [3] * bool(structures) + [1.5] * len(predicted)
    right = rrb.Vertical(*parts, row_shares=shares)
    return rrb.Horizontal(left, right, column_shares=[2, 3], name="Diagnosis")


def _residual_tab(
    stream: rr.RecordingStream, diagnosis: Diagnosis, recording: Recording, rows: list[int]
) -> rrb.Container:
    """A row per output: its residual over time, over frequency and over amplitude."""
    kinds = [
        log(stream, diagnosis, recording, rows)
        for log in (log_over_time, log_over_frequency, log_over_amplitude)
    ]
    columns = [rrb.Vertical(*views) for views in kinds if views]
    return rrb.Horizontal(*columns, name="Residuals")


def _summary(title: str, diagnosis: Diagnosis, recording: Diagnosed) -> str:
    """Verdict, findings, errors and calibration in Markdown."""
    lines = [f"# {plain(title)}", "", plain(headline(diagnosis).sentence)]
    if diagnosis.verdict == UNEXPLAINED and isinstance(recording, Recording) and diagnosis.spectra is None:
        lines += ["", plain(f"What is left: {where(leftover(diagnosis, recording))}.")]
    if diagnosis.findings:
        lines += ["", "## Findings", "", *_findings(diagnosis)]
    for name, table in (
        ("Errors on data kept aside", error_table(diagnosis)),
        ("Calibration", calibration_table(diagnosis)),
    ):
        if table.rows:
            lines += ["", f"## {name}", "", _row(table.heads), "|" + "---|" * len(table.heads)]
            lines += [_row(row) for row in table.rows]
    lines += ["", *[f"- {plain(warning)}" for warning in diagnosis.warnings]]
    return "\n".join(lines)


def _findings(diagnosis: Diagnosis) -> list[str]:
    """One entry of a list each, since a table would be wider than its view."""
    return [
        f"1. {plain(cause)} at {plain(location)}: {plain(parameters)}; evidence {gain}; it removes {share} of the error "
        "above the noise floor"
        for cause, location, parameters, gain, share in finding_table(diagnosis).rows
    ]


def _row(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(plain(cell) for cell in cells) + " |"
