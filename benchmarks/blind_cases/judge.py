"""Judge: an answer held against what was hidden."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.blind_cases.truth import Case, Hidden
from lab.diagnosis.outcome import CONSISTENT, EXPLAINED, UNEXPLAINED, Diagnosis, Finding

UNSCORED = ("phase",)
"""Parameters that depend on the instant at which the record starts."""


def judged(case: Case, diagnosis: Diagnosis, *, withheld: bool = False) -> dict[str, Any]:
    """What was hidden, what was said, and whether that is right, as plain data.

    Args:
        case: with the truth.
        diagnosis: of its recording by its model.
        withheld: whether the hidden cause was taken out of the catalogue, so that nothing is to be explained.
    """
    told = [(f.effect.cause, f.effect.location) for f in diagnosis.findings]
    cause, place = _right(case, diagnosis, told, withheld)
    scores = [
        score for h in case.hidden for f in diagnosis.findings if _same(h, f) for score in _scores(h, f)
    ]
    errors = diagnosis.errors
    return {
        "hidden": [[h.cause, h.location, dict(h.parameters)] for h in case.hidden],
        "verdict": diagnosis.verdict,
        "told": [list(pair) for pair in told],
        "gains": [f.log_evidence_gain for f in diagnosis.findings],
        "alternatives": [[a.cause, a.location, a.log_evidence_gain] for a in diagnosis.alternatives],
        "cause_right": cause,
        "place_right": place,
        "scores": scores,
        "holdout_gain": sum(f.holdout_gain for f in diagnosis.findings),
        "errors": [errors.noise_floor, errors.nominal, errors.calibrated, errors.extended],
        "warnings": list(diagnosis.warnings),
        "jitter": case.jitter,
        "deflection": case.deflection,
    }


def _right(
    case: Case, diagnosis: Diagnosis, told: list[tuple[str, str]], withheld: bool
) -> tuple[bool, bool]:
    """Whether the causes are right, and whether their places are too."""
    if withheld or any(h.outside for h in case.hidden):
        right = diagnosis.verdict == UNEXPLAINED
        return right, right
    if not case.hidden:
        right = diagnosis.verdict == CONSISTENT and not told
        return right, right
    cause = sorted(c for c, _ in told) == sorted(h.cause for h in case.hidden)
    # A law that only resembles the catalogue's may be left partly unexplained; an exact one may not.
    cause = cause and (diagnosis.verdict == EXPLAINED or not all(h.exact for h in case.hidden))
    return cause, cause and all(any(_same(h, f) for f in diagnosis.findings) for h in case.hidden)


def _same(hidden: Hidden, finding: Finding) -> bool:
    """Whether a finding names what was hidden, where it was hidden."""
    pair = sorted(hidden.location.split("|"))
    at = sorted(finding.effect.location.split("|")) == pair or finding.effect.location in hidden.also
    return finding.effect.cause == hidden.cause and at


def _scores(hidden: Hidden, finding: Finding) -> list[list[float]]:
    """Relative error, and error in standard deviations, of every parameter."""
    scores = []
    for name, value in hidden.parameters.items():
        found = finding.parameters.get(name)
        if found is None or not value or name in UNSCORED:
            continue
        away = abs(found.value - value)
        scores.append([away / abs(value), away / found.std if found.std > 0 else float("inf")])
    return scores


def said(row: Mapping[str, Any]) -> str:
    """What an answer says in a few words."""
    names = " + ".join(f"{cause}@{place}" for cause, place in row["told"])
    return f"{row['verdict']}: {names}" if names else str(row["verdict"])
