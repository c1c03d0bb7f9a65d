"""One screen that tells what a placement came to."""

from __future__ import annotations

import textwrap

from lab.placement.outcome import Placement
from lab.show.findings import Table
from lab.show.placements import cause_table, drive_table, ranking_table, verdict_of

WIDTH = 100
MAX_CAUSES = 6


def placement_summary(placement: Placement) -> str:
    """Layout chosen, its rivals, other signals, causes and warnings, as lines of text."""
    causes = cause_table(placement)
    parts = [
        _filled(verdict_of(placement).sentence),
        _list("sensors", placement.sensors) + "\n" + _list("actuators", placement.actuators),
        "\n".join(_list(f"set-up {k + 1}", each) for k, each in enumerate(placement.setups)),
        _columns("layouts compared", ranking_table(placement, layouts=False)),
        _columns(_drive_title(placement), drive_table(placement)),
        _columns("causes most easily mistaken", Table(causes.heads, causes.rows[:MAX_CAUSES])),
        _inseparable(placement),
        "\n".join(_filled(f"warning: {each}") for each in placement.warnings),
    ]
    return "\n\n".join(part.strip("\n") for part in parts if part.strip())


def _list(name: str, members: tuple[str, ...]) -> str:
    return _filled(f"{name}: {', '.join(members)}") if members else ""


def _drive_title(placement: Placement) -> str:
    figure = f"; figure: {placement.drive_measure}" if placement.drive_measure else ""
    return _filled(f"other signals, largest force the same or as told{figure}")


def _inseparable(placement: Placement) -> str:
    groups = placement.inseparable
    if not groups:
        alone = placement.target == "diagnosis"
        return "told apart by no layout: none of the causes considered" if alone else ""
    told = "; ".join(" = ".join(group) for group in groups[:2])
    more = f"; and {len(groups) - 2} more groups in placement.json" if len(groups) > 2 else ""
    return _filled(f"told apart by no layout: {told}{more}")


def _columns(title: str, table: Table) -> str:
    """A table as text, its columns as wide as they must be."""
    if not table.rows:
        return ""
    lines = [tuple(head.lower() for head in table.heads), *table.rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(table.heads))]
    rows = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]
    return "\n".join([title, *(f"  {row.rstrip()}" for row in rows)])


def _filled(text: str) -> str:
    return textwrap.fill(text, WIDTH)
