"""A placement in words and rows of text, the same for the report, the viewer and the screen."""

from __future__ import annotations

import math

from lab.placement.outcome import Placement, Ranked
from lab.show.findings import Table
from lab.show.verdict import FOUND, PASSED, Verdict

DETAILS = {
    "modes": {"d": "D", "a": "A", "e": "E", "mac": "MAC"},
    "matrices": {"mass": "M [%]", "damping": "C [%]", "stiffness": "K [%]", "d": "D [%]", "e": "E [%]"},
    "diagnosis": {"any": "Any wrong [%]"},
}
"""Further figures of a layout, and how they are headed."""
PERCENT = {"matrices", "diagnosis"}
"""Targets whose figures are shares."""


def verdict_of(placement: Placement) -> Verdict:
    """What the placement comes to, in a few sentences for an engineer."""
    p = placement
    value = figure_text(p, p.figure)
    parts = [f"{p.measure[0].upper()}{p.measure[1:]}: {value} with the layout chosen."]
    if p.proven:
        others = (
            f"{p.n_possible} of {p.n_layouts} layouts"
            if p.n_possible < p.n_layouts
            else f"{p.n_layouts} layouts"
        )
        can = " that can give what is asked for" if p.n_possible < p.n_layouts else ""
        parts.append(f"No other is better: all {others}{can} were compared.")
    elif p.floor is not None:
        parts.append(
            f"Of {p.n_layouts:.3g} layouts none can go below {figure_text(p, p.floor)}, so that at most "
            f"{share(gap(p))} could be gained."
        )
    else:
        parts.append(
            f"It is the best that a search among {p.n_layouts:.3g} layouts found; that none is better is not proven."
        )
    parts += [_beside(p, other) for other in p.ranking if other.name == "planned"]
    return Verdict(PASSED if p.proven else FOUND, " ".join(parts))


def gap(placement: Placement) -> float:
    """Share of the figure that a better layout could gain at most."""
    if placement.floor is None or not placement.figure > 0:
        return math.nan
    return max(1 - placement.floor / placement.figure, 0.0)


def figure_text(placement: Placement, value: float) -> str:
    """A figure as text, in percent where it is a share."""
    if not math.isfinite(value):
        return "impossible"
    return share(value) if placement.target in PERCENT else f"{value:.4g}"


def share(value: float) -> str:
    """A share in percent."""
    return "not known" if math.isnan(value) else f"{100 * value:.3g} %"


def ranking_table(placement: Placement, *, layouts: bool = True) -> Table:
    """Layouts with their figures; `layouts` tells the channels too."""
    p, more = placement, DETAILS[placement.target]
    shown = {name: head for name, head in more.items() if any(name in row.details for row in p.ranking)}
    heads = ["Layout", "Rank", "Figure", "Worse by", *shown.values()]
    rows = []
    for row in p.ranking:
        details = [_detail(p, row, name) for name in shown]
        rank = "" if row.rank is None else str(row.rank)
        worse = "" if not p.figure > 0 else share(row.figure / p.figure - 1)
        if not math.isfinite(row.figure):
            worse = ""
        own = [row.name, rank, figure_text(p, row.figure), worse, *details]
        rows.append((*own, ", ".join(row.sensors), ", ".join(row.actuators)) if layouts else tuple(own))
    return Table((*heads, *(("Sensors", "Actuators") if layouts else ())), tuple(rows))


def drive_table(placement: Placement) -> Table:
    """Other signals and levels for the layout chosen."""
    return Table(
        ("Signal", "Duration [s]", "Largest force [N]", "Figure"),
        tuple(
            (d.excitation, f"{d.duration:.4g}", f"{d.peak:.4g}", _drive_figure(placement, d.figure))
            for d in placement.drives
        ),
    )


def _drive_figure(placement: Placement, value: float) -> str:
    if placement.drive_measure and math.isfinite(value):
        return share(value)
    return figure_text(placement, value)


def cause_table(placement: Placement) -> Table:
    """Causes, the most easily mistaken first."""
    return Table(
        ("Cause", "Location", "Visible by [std]", "Taken for", "Probability", "Any wrong"),
        tuple(
            (c.cause, c.location, f"{c.visibility:.3g}", c.rival, share(c.confusion), share(c.mistaken))
            for c in placement.causes
        ),
    )


def _beside(placement: Placement, other: Ranked) -> str:
    place = f", rank {other.rank} of {placement.n_possible}" if other.rank else ""
    if not math.isfinite(other.figure):
        return "The planned layout cannot give what is asked for."
    return f"The planned layout reaches {figure_text(placement, other.figure)}{place}."


def _detail(placement: Placement, row: Ranked, name: str) -> str:
    value = row.details.get(name, math.nan)
    if math.isnan(value):
        return ""
    if not math.isfinite(value):
        return "∞"
    return f"{100 * value:.3g}" if placement.target in PERCENT else f"{value:.4g}"
