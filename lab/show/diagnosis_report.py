"""The report of a diagnosis: verdict, findings, errors, figures, calibration, and what it takes to reproduce it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from identification.recording import Recording
from lab.diagnosis.outcome import UNEXPLAINED, Diagnosis
from lab.diagnosis.restoring import restoring_force
from lab.show.diagnosed import Diagnosed, about, title_of
from lab.show.figures.canvas import Drawing
from lab.show.figures.causes import calibration_figure, causes_figure
from lab.show.figures.diagnosis import figures_of
from lab.show.figures.restoring import restoring_figure
from lab.show.findings import (
    alternative_table,
    calibration_table,
    error_table,
    finding_table,
    noise_table,
    where,
)
from lab.show.headline import GLOSSARY, headline
from lab.show.model_modes import mode_changes
from lab.show.page import checksums, inline, surroundings, template
from lab.show.residuals import leftover

BESIDE = ("diagnosis.json", "extended.xml")
"""Files of the same folder that the report vouches for."""


def write_diagnosis_report(
    path: str | Path,
    diagnosis: Diagnosis,
    recording: Diagnosed,
    *,
    command: str = "",
    facts: Mapping[str, str] | None = None,
) -> None:
    """Writes one HTML file that needs no other; the same data give the same bytes.

    Args:
        path: file to come; diagnosis.json and extended.xml beside it are named with their checksums.
        diagnosis: what was found.
        recording: what it was found in, with the channels of the diagnosis.
        command: how the lab was called.
        facts: further facts to reproduce the diagnosis, by name.
    """
    path = Path(path)
    restoring = restoring_force(diagnosis, recording) if isinstance(recording, Recording) else None
    standing = any(channel.quantity == "displacement" for channel in recording.outputs)
    figures: list[Callable[[], Drawing | None]] = [
        partial(causes_figure, diagnosis),
        *([] if restoring is None else [partial(restoring_figure, restoring, static=standing)]),
        *figures_of(diagnosis, recording),
        partial(calibration_figure, diagnosis),
    ]
    drawings = [figure() for figure in figures]
    own = {**surroundings(), **checksums(path.parent, BESIDE)}
    page = template("diagnosis.html.jinja").render(
        title=title_of(diagnosis, recording),
        about=about(diagnosis, recording),
        verdict=headline(diagnosis),
        rest=_rest(diagnosis, recording),
        changes=mode_changes(diagnosis),
        glossary=GLOSSARY,
        findings=finding_table(diagnosis),
        sentences=[finding.says for finding in diagnosis.findings],
        alternatives=alternative_table(diagnosis),
        errors=error_table(diagnosis),
        calibration=calibration_table(diagnosis),
        figures=[inline(drawing) for drawing in drawings if drawing is not None],
        explanation="",
        warnings=diagnosis.warnings,
        unlearnable=diagnosis.unlearnable,
        noise=noise_table(diagnosis),
        command=command,
        scenario_text="",
        facts=list({**(facts or {}), **own}.items()),
    )
    path.write_text(page, encoding="utf-8", newline="\n")


def _rest(diagnosis: Diagnosis, recording: Diagnosed) -> str:
    """Where an unexplained error sits; nothing where all is explained, or where spectra tell no time."""
    if (
        diagnosis.verdict != UNEXPLAINED
        or diagnosis.spectra is not None
        or not isinstance(recording, Recording)
    ):
        return ""
    text = where(leftover(diagnosis, recording))
    return f"{text[:1].upper()}{text[1:]}."
