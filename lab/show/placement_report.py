"""The report of a placement: the layout chosen, its rivals, other signals, causes, and what it takes to reproduce it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from lab.placement.outcome import Placement
from lab.rig import Rig
from lab.show.figures.placement import draw_placement
from lab.show.findings import Table
from lab.show.page import checksums, inline, surroundings, template
from lab.show.placements import cause_table, drive_table, ranking_table, verdict_of

MAX_CAUSES = 40


def write_placement_report(
    path: str | Path,
    placement: Placement,
    rig: Rig,
    *,
    command: str = "",
    facts: Mapping[str, str] | None = None,
) -> None:
    """Writes one HTML file that needs no other; the same data give the same bytes.

    Args:
        path: file to come; placement.json beside it is named with its checksum.
        placement: what was chosen.
        rig: with every candidate connected.
        command: how the lab was called.
        facts: further facts to reproduce the placement, by name.
    """
    path = Path(path)
    own = {**surroundings(), **checksums(path.parent, ("placement.json",))}
    ranking, causes = ranking_table(placement), cause_table(placement)
    chosen = [("Sensors", placement.sensors), ("Actuators", placement.actuators)]
    chosen += [(f"Set-up {k + 1}, references first", each) for k, each in enumerate(placement.setups)]
    page = template("placement.html.jinja").render(
        title=f"{placement.model}: placement for {placement.target}",
        about=(
            f"Model {rig.name} ({len(rig.dofs)} degrees of freedom), {len(placement.sensors)} of {len(rig.outputs)} outputs "
            f"and {len(placement.actuators)} of {len(rig.inputs)} inputs."
        ),
        verdict=verdict_of(placement),
        measure=placement.measure,
        chosen=[(name, ", ".join(members)) for name, members in chosen if members],
        ranking=ranking,
        texts=(len(ranking.heads) - 2, len(ranking.heads) - 1),
        drives=drive_table(placement),
        drive_measure=placement.drive_measure,
        shifts=_shift_table(placement),
        causes=Table(causes.heads, causes.rows[:MAX_CAUSES]),
        inseparable=placement.inseparable,
        figures=[inline(drawing) for drawing in draw_placement(placement, rig)],
        explanation="",
        warnings=placement.warnings,
        command=command,
        scenario_text="",
        facts=list({**(facts or {}), **own}.items()),
    )
    path.write_text(page, encoding="utf-8", newline="\n")


def _shift_table(placement: Placement) -> Table:
    shifts = placement.frequency_shifts
    return Table(
        ("Mode", "Change of frequency [%]"),
        tuple((str(k + 1), f"{100 * shift:.3g}") for k, shift in enumerate(shifts)),
    )
