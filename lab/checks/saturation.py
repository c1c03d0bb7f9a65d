"""Readings that follow another channel up to a level, and stay there while the other goes on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from identification.recording import Array
from lab.checks.remark import Remark
from lab.checks.survey import Sheet, Survey

BEYOND = 0.25
"""Share of its range that the other channel goes on; over as much before, the reading must have followed."""

STRAIGHT = 0.9
"""Squared correlation of a reading that follows."""

FLAT = 0.05
"""Slope beyond over slope before, of a reading that stays; a spring that merely hardens keeps more."""

NARROW = 0.1
"""Scatter of a level and its distance from the largest reading, over the range of the reading."""

MIN_CELLS = 20
"""Cells of the record on either side of the bend."""

BENDS = 24
"""Places where the bend is tried."""


@dataclass(frozen=True)
class Bend:
    """Where a reading stops following.

    Attributes:
        level: at which it stays.
        at: value of the other channel from where on it stays.
        farthest: value of the other channel up to which it stays.
        slope: beyond over before.
        cells: number of the cells beyond.
    """

    level: float
    at: float
    farthest: float
    slope: float
    cells: Array


def saturation(survey: Survey) -> list[Remark]:
    """Channels that level off at one end, noise on top, while a channel that they followed goes on.

    Means over cells of the record are compared, in which noise is small and what is slow remains. A linear structure either
    follows all along or, near its resonances, not at all.
    """
    return [remark for sheet in survey.sheets for remark in _of_sheet(sheet)]


def _of_sheet(sheet: Sheet) -> Iterator[Remark]:
    cells = sheet.levels.cells
    size = -(-sheet.n_samples // cells.shape[1])
    for trace in sheet.traces():
        found = [
            (bend, sheet.channels[row])
            for row in range(len(cells))
            if row != trace.row
            for sign in (1.0, -1.0)
            if (bend := bend_of(sign * cells[row], cells[trace.row])) is not None
        ]
        if not found:
            continue
        # The channel that shows most of the level tells where it is.
        bend, other = max(found, key=lambda each: each[0].cells.size)
        moved = abs(bend.farthest - bend.at)
        yield Remark(
            "saturation",
            trace.channel.name,
            "fault",
            f"follows {other.name} up to {bend.level:.3g} {trace.channel.unit} and stays there while {other.name} goes on by "
            f"{moved:.3g} {other.unit}",
            "its sensor or amplifier has reached its limit, or the structure a stop; choose a larger range, and leave these "
            "stretches out",
            trace.number,
            float(bend.cells[0] * size) / sheet.sample_rate,
            float(min((bend.cells[-1] + 1) * size, sheet.n_samples)) / sheet.sample_rate,
            {"level": bend.level, "slope_ratio": bend.slope},
        )


def bend_of(u: Array, y: Array) -> Bend | None:
    """The bend beyond which a reading y stays while u rises on; None where there is none.

    Args:
        u, y: means over the same cells of two channels, NaN where missing, (n_cells,).
    """
    there = np.flatnonzero(np.isfinite(u) & np.isfinite(y))
    if there.size < 2 * MIN_CELLS:
        return None
    u, y = u[there], y[there]
    low, high = float(u.min()), float(u.max())
    width, range_y = BEYOND * (high - low), float(np.ptp(y))
    if not width or not range_y:
        return None
    found = None
    # From the far end inwards: the level reaches as far as it can.
    for at in np.linspace(high - width, low + width, BENDS):
        before, beyond = (u <= at) & (u > at - width), u > at
        if min(before.sum(), beyond.sum()) < MIN_CELLS:
            continue
        rising, straight = _slope(u[before], y[before])
        staying, _ = _slope(u[beyond], y[beyond])
        level = float(np.median(y[beyond]))
        extreme = y.max() if rising > 0 else y.min()
        if (
            straight > STRAIGHT
            and abs(staying) < FLAT * abs(rising)
            and np.std(y[beyond]) < NARROW * range_y
            and abs(level - extreme) < NARROW * range_y
        ):
            found = Bend(level, float(at), high, float(staying / rising), there[beyond])
    return found


def _slope(u: Array, y: Array) -> tuple[float, float]:
    """Slope of a straight line through points, and the squared correlation."""
    du, dy = u - u.mean(), y - y.mean()
    uu, yy, uy = float(du @ du), float(dy @ dy), float(du @ dy)
    if not uu or not yy:
        return 0.0, 0.0
    return uy / uu, uy**2 / (uu * yy)
