"""Single wrong samples."""

from __future__ import annotations

from lab.checks.remark import Remark
from lab.checks.surprises import own_surprises
from lab.checks.survey import Survey

SHARE = 0.05
"""Size of a spike worth a word, over the RMS of its channel."""

MIN_STEPS = 5
"""The same in steps of a rounded channel."""


def spikes(survey: Survey) -> list[Remark]:
    """Outputs with single samples that neither the past nor the future of the channel explains."""
    remarks = []
    for sheet in survey.sheets:
        v = sheet.levels
        for t in sheet.traces():
            if t.is_input and sheet.record.kind != "random":
                continue
            floor = max(SHARE * v.rms[t.row], MIN_STEPS * v.step[t.row])
            found = [o for o in own_surprises(sheet, t.row, "spike") if abs(o.size) > floor]
            if not found:
                continue
            top = max(found, key=lambda o: abs(o.size))
            times = sorted(o.sample for o in found)
            remarks.append(
                Remark(
                    "spikes",
                    t.channel.name,
                    "doubt",
                    f"{len(found)} spike{'s' * (len(found) > 1)}, the largest {top.size:.3g} {t.channel.unit} "
                    f"({abs(top.size) / v.rms[t.row]:.2g} x RMS) at t = {top.sample / sheet.sample_rate:.6g} s",
                    "mark these samples as missing, and look for a loose contact",
                    t.number,
                    times[0] / sheet.sample_rate,
                    (times[-1] + 1) / sheet.sample_rate,
                    {"spikes": len(found), "largest": top.size, "ratio": top.ratio},
                )
            )
    return remarks
