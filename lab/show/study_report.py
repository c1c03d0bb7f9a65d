"""The report of a study: how many runs, the statistics of every point, figures, and what it takes to reproduce it."""

from __future__ import annotations

from pathlib import Path

from lab.show.figures.study import draw_study
from lab.show.page import checksums, inline, surroundings, template
from lab.show.verdict import Verdict
from lab.studies.outcome import Outcome
from lab.studies.wording import number, settings, told, varied, words

BESIDE = ("study.h5",)
"""Files of the same folder that the report vouches for."""
MAX_ROWS = 200
"""Points in the table; a longer one nobody reads."""


def write_study_report(path: str | Path, outcome: Outcome, *, command: str = "") -> None:
    """Writes one HTML file that needs no other.

    Args:
        path: file to come; study.h5 beside it is named with its checksum.
        outcome: what to tell.
        command: how the study was called.
    """
    path, study = Path(path), outcome.study
    page = template("study.html.jinja").render(
        title=study.title,
        about=f"{study.n_points} points, {study.repeats} repeats each: {study.n_runs} runs.",
        verdict=_verdict(outcome),
        heads=[*varied(outcome), *(words(each) for each in outcome.statistics)],
        rows=_rows(outcome),
        n_settings=len(varied(outcome)),
        left_out=max(0, study.n_points - MAX_ROWS),
        figures=[inline(each) for each in draw_study(outcome)],
        explanation="",
        warnings=outcome.warnings,
        command=command,
        study_text=study.text,
        scenario_text=study.scenario_text,
        facts=list({"Seed": str(study.seed), **surroundings(), **checksums(path.parent, BESIDE)}.items()),
    )
    path.write_text(page, encoding="utf-8", newline="\n")


def _verdict(outcome: Outcome) -> Verdict:
    n = outcome.study.n_runs
    if not outcome.n_failed:
        return Verdict("passed", f"All {n} runs finished.")
    return Verdict(
        "failed", f"{outcome.n_failed} of {n} runs failed; the statistics are those of the others."
    )


def _rows(outcome: Outcome) -> list[list[str]]:
    study = outcome.study
    return [
        [
            *(told(value) for value in settings(outcome, point)),
            *(number(each, point) for each in outcome.statistics),
        ]
        for point in range(min(study.n_points, MAX_ROWS))
    ]
