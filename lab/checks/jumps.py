"""Levels that step to another value from one sample to the next."""

from __future__ import annotations

from collections.abc import Sequence

from lab.checks.outliers import Outlier
from lab.checks.remark import Remark
from lab.checks.spikes import MIN_STEPS
from lab.checks.surprises import own_surprises
from lab.checks.survey import Sheet, Survey

SHARE = 0.2
"""Size of a jump worth a word, over the RMS of its channel."""

SHORT = 4
"""Samples after which a level that is back was never a new one."""


def jumps(survey: Survey) -> list[Remark]:
    """Outputs whose level jumps and stays, as when an encoder loses counts or an amplifier switches range."""
    remarks = []
    for sheet in survey.sheets:
        for t in sheet.traces():
            if t.is_input:
                continue
            found = level_jumps(sheet, t.row)
            if not found:
                continue
            top = max(found, key=lambda o: abs(o.size))
            times = sorted(o.sample for o in found)
            remarks.append(
                Remark(
                    "jumps",
                    t.channel.name,
                    "fault",
                    f"{len(found)} jump{'s' * (len(found) > 1)} of the level, the largest {top.size:.3g} "
                    f"{t.channel.unit} at t = {top.sample / sheet.sample_rate:.6g} s",
                    "cut the record there, or correct the offset after the jump",
                    t.number,
                    times[0] / sheet.sample_rate,
                    (times[-1] + 1) / sheet.sample_rate,
                    {"jumps": len(found), "largest": top.size, "ratio": top.ratio},
                )
            )
    return remarks


def level_jumps(sheet: Sheet, row: int) -> list[Outlier]:
    """Jumps of one channel that last and are worth a word."""
    floor = max(SHARE * sheet.levels.rms[row], MIN_STEPS * sheet.levels.step[row])
    found = _lasting(own_surprises(sheet, row, "jump"), sheet.outliers[row])
    return [o for o in found if abs(o.size) > floor]


def _lasting(jumps: Sequence[Outlier], others: Sequence[Outlier]) -> list[Outlier]:
    """The jumps that no opposite surprise undoes at once."""
    return [
        jump
        for jump in jumps
        if not any(
            0 < abs(other.sample - jump.sample) <= SHORT and other.size * jump.size < -0.25 * jump.size**2
            for other in others
        )
    ]
