"""Samples that are not there: NaN or infinite."""

from __future__ import annotations

from lab.checks.remark import Remark
from lab.checks.survey import Survey

MANY = 0.01
"""Share of missing samples from which on a channel is at fault."""


def missing(survey: Survey) -> list[Remark]:
    """Channels with samples that are no finite numbers."""
    remarks = []
    for sheet in survey.sheets:
        v = sheet.levels
        for t in sheet.traces():
            n = int(v.n_missing[t.row])
            if n == 0:
                continue
            share = n / max(sheet.n_samples, 1)
            remarks.append(
                Remark(
                    "missing",
                    t.channel.name,
                    "fault" if share > MANY else "doubt",
                    f"{n} samples are missing ({100 * share:.2g} %)",
                    "cut the record to a complete stretch, or leave the channel out",
                    t.number,
                    v.first_missing[t.row] / sheet.sample_rate,
                    (v.last_missing[t.row] + 1) / sheet.sample_rate,
                    {"missing_samples": n, "share": share},
                )
            )
    return remarks
