"""The remarks of a check on one screen, and as plain data."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

from identification.recording import Recording
from lab.checks import CHECKS
from lab.checks.remark import SEVERITIES, Remark

WIDTH = 100
MAX_SHOWN = 12


def screen(
    recording: Recording, remarks: Sequence[Remark], model: str | None = None, *, faults_alone: bool = False
) -> str:
    """The remarks as text, the most serious first; those beyond one screen are counted.

    Args:
        recording: what was looked at.
        remarks: what `check` gives.
        model: name of the model's file, where there was one.
        faults_alone: leave out what is no fault, and the headline.
    """
    shown = [remark for remark in remarks if remark.severity == SEVERITIES[0] or not faults_alone]
    lines = [] if faults_alone else [_headline(recording, remarks, model)]
    lines += [_told(remark, len(recording.records)) for remark in shown[:MAX_SHOWN]]
    if len(shown) > MAX_SHOWN:
        rest = sorted({remark.check for remark in shown[MAX_SHOWN:]})
        lines.append(f"… and {len(shown) - MAX_SHOWN} more ({', '.join(rest)}): see them with --json")
    return "\n".join(lines)


def document(recording: Recording, remarks: Sequence[Remark], model: str | None = None) -> dict[str, Any]:
    """Plain data for JSON."""
    return {
        "format": "modal-check",
        "version": 1,
        "title": recording.title,
        "model": model,
        "checks": list(CHECKS),
        "remarks": [remark.to_data() for remark in remarks],
    }


def _headline(recording: Recording, remarks: Sequence[Remark], model: str | None) -> str:
    counts = [
        f"{n} {severity}{'s' * (n > 1)}"
        for severity in SEVERITIES
        if (n := sum(remark.severity == severity for remark in remarks))
    ]
    verdict = ", ".join(counts) if counts else "nothing to remark"
    against = f" against {model}" if model is not None else ""
    return f"{recording!r}{against}\n{len(CHECKS)} checks: {verdict}"


def _told(remark: Remark, n_records: int) -> str:
    place = f"record {remark.record}, " if n_records > 1 else ""
    when = f"{place}{remark.start:.5g} to {remark.stop:.5g} s"
    records = remark.evidence.get("records")
    many = f", in {records:.0f} records" if records else ""
    head = f"{remark.severity:<5} {remark.check}: {remark.channel or 'all channels'} {remark.says} [{when}{many}]."
    return textwrap.fill(f"{head} Advice: {remark.advice}.", WIDTH, subsequent_indent="      ")
