"""Levels that step to another value from one sample to the next."""

from __future__ import annotations

from collections.abc import Sequence

from lab.checks.outliers import Outlier
from lab.checks.remark import Remark
from lab.checks.spikes import MIN_STEPS
from lab.checks.surprises import own_surprises
from lab.checks.survey import Survey

SHARE = 0.2
"""Size of a jump worth a word, over the RMS of its channel."""

SHORT = 4
"""Samples after which a level that is back was never a new one."""


def jumps(survey: Survey) -> list[Remark]:
    """Outputs whose level jumps and stays, as when an encoder loses counts or an amplifier switches range."""
    remarks = []
    for sheet in survey.sheets:
        v = sheet.levels
        for t in sheet.traces():
            if t.is_input:
                continue
            floor = max(SHARE * v.rms[t.row], MIN_STEPS * v.step[t.row])
            found = _lasting(own_surprises(sheet, t.row, "jump"), sheet.outliers[t.row])
            found = [o for o in found if abs(o.size) > floor]
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
