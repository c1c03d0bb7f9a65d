"""The report: verdict, the tables it rests on, figures, and what it takes to reproduce it, in one HTML file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from identification.progress import UNHEARD, Work
from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.result import Result
from lab.show.figures import draw, matrix_maps
from lab.show.page import checksums, inline, surroundings, template
from lab.show.recorded import recorded
from lab.show.tables import (
    MAX_PRINTED,
    criteria_rows,
    matrix_summary,
    matrix_tables,
    modes_table,
    same_dofs,
    validation_rows,
)
from lab.show.verdict import verdict

BESIDE = ("recording.h5", "result.json")
"""Files of the same folder that the report vouches for."""


def write_report(
    path: str | Path,
    result: Result,
    recording: Recording | FrequencyResponse,
    *,
    scenario_text: str = "",
    command: str = "",
    facts: Mapping[str, str] | None = None,
    work: Work = UNHEARD,
) -> None:
    """Writes one HTML file that needs no other; the same data give the same bytes.

    Args:
        path: file to come; recording.h5 and result.json beside it are named with their checksums.
        result: what was identified.
        recording: what it was identified from.
        scenario_text: the scenario as written.
        command: how the lab was called.
        facts: further facts to reproduce the result, by name.
        work: told of every figure.
    """
    path = Path(path)
    page = template("report.html.jinja").render(
        title=result.title or "Modal test",
        about=_about(result, recording),
        verdict=verdict(result),
        criteria=criteria_rows(result),
        validation=validation_rows(result),
        compared=_compared(result),
        modes=modes_table(result),
        **_matrices(result),
        figures=[inline(drawing) for drawing in draw(result, recording, work=work)],
        explanation=result.explanation or " ".join(result.notes),
        warnings=result.warnings,
        command=command,
        scenario_text=scenario_text,
        facts=list(_all_facts(path, result, scenario_text, facts or {}).items()),
    )
    path.write_text(page, encoding="utf-8", newline="\n")


def _about(result: Result, recording: Recording | FrequencyResponse) -> str:
    realization = result.realization
    return f"Identified by {realization.method}, order {realization.order}, from {recorded(recording)}."


def _compared(result: Result) -> str:
    """How many modes the validation rests on."""
    if result.comparison is None:
        return ""
    n = len(result.comparison.pairs)
    return f"{n} of {n + len(result.comparison.missed)} modes of the model were found and are compared."


def _matrices(result: Result) -> dict[str, Any]:
    found = result.second_order
    if found is None:
        return {"matrices": [], "matrix_summary": [], "matrix_figure": None, "dofs": ()}
    truth = same_dofs(result.truth_second_order, found.dofs)
    printed = len(found.dofs) <= MAX_PRINTED
    return {
        "matrices": matrix_tables(found, truth) if printed else [],
        "matrix_summary": matrix_summary(found, truth) if truth is not None else [],
        "matrix_figure": None if printed else inline(matrix_maps(found, truth)),
        "dofs": found.dofs,
    }


def _all_facts(path: Path, result: Result, scenario_text: str, facts: Mapping[str, str]) -> dict[str, str]:
    """What was given, then how the method was set, what it ran on, and what the files contained."""
    settings = ", ".join(f"{name} = {value}" for name, value in result.realization.settings.items())
    own = {"Method": f"{result.realization.method}, order {result.realization.order}"}
    if settings:
        own["Settings of the method"] = settings
    own |= surroundings()
    if scenario_text:
        own["SHA-256 of the scenario"] = hashlib.sha256(scenario_text.encode("utf-8", "replace")).hexdigest()
    own |= checksums(path.parent, BESIDE)
    return {**facts, **{name: value for name, value in own.items() if name not in facts}}
