"""One screen that tells what a diagnosis came to."""

from __future__ import annotations

import textwrap

from lab.diagnosis.outcome import Diagnosis
from lab.show.diagnosed import Diagnosed
from lab.show.findings import Table, alternative_table, error_table, finding_table, verdict_of

WIDTH = 100
MAX_ALTERNATIVES = 3
MAX_CALIBRATED = 3
"""Parameters named: those that moved most."""
MAX_UNLEARNABLE = 3


def diagnosis_summary(diagnosis: Diagnosis, recording: Diagnosed) -> str:
    """Verdict, findings, alternatives, errors, calibration and warnings, as lines of text."""
    alternatives = alternative_table(diagnosis)
    short = Table(alternatives.heads[:4], tuple(row[:4] for row in alternatives.rows[:MAX_ALTERNATIVES]))
    parts = [
        _filled(verdict_of(diagnosis, recording).sentence),
        _columns("findings", finding_table(diagnosis)),
        _columns("alternatives to the first", short),
        _columns("error on data kept aside", error_table(diagnosis)),
        _calibration(diagnosis),
        _unlearnable(diagnosis),
        "\n".join(_filled(f"warning: {each}") for each in diagnosis.warnings),
    ]
    return "\n\n".join(part for part in parts if part)


def _columns(title: str, table: Table) -> str:
    """A table as text, its columns as wide as they must be."""
    if not table.rows:
        return ""
    lines = [tuple(head.lower() for head in table.heads), *table.rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(table.heads))]
    rows = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]
    return "\n".join([title, *(f"  {row.rstrip()}" for row in rows)])


def _calibration(diagnosis: Diagnosis) -> str:
    """The parameters that moved most, relative to their nominal values."""
    moved = {
        name: each.value / each.nominal - 1 for name, each in diagnosis.calibration.items() if each.nominal
    }
    most = sorted(moved, key=lambda name: -abs(moved[name]))[:MAX_CALIBRATED]
    if not most:
        return ""
    listed = ", ".join(f"{name} {100 * moved[name]:+.2g} %" for name in most)
    return _filled(f"calibration moved most: {listed}")


def _unlearnable(diagnosis: Diagnosis) -> str:
    """What these data cannot tell; a long list is in the report."""
    told, rest = diagnosis.unlearnable[:MAX_UNLEARNABLE], diagnosis.unlearnable[MAX_UNLEARNABLE:]
    more = (f"and {len(rest)} more in diagnosis.json",) if rest else ()
    return "\n".join(_filled(f"not told by these data: {each}") for each in (*told, *more))


def _filled(text: str) -> str:
    return textwrap.fill(text, WIDTH)
