"""Two channels with one and the same signal."""

from __future__ import annotations

import numpy as np

from lab.checks.remark import Remark
from lab.checks.survey import Sheet, Survey

LOOKED = 8192


def twins(survey: Survey) -> list[Remark]:
    """Outputs that repeat another output sample by sample, or its negative: one cable on two inputs.

    No two sensors agree to the last digit of their noise; noise-free simulations of symmetric structures do.
    """
    return [remark for sheet in survey.sheets for remark in _twins(sheet)]


def _twins(sheet: Sheet) -> list[Remark]:
    v, seen, remarks = sheet.levels, {}, []  # type: ignore[var-annotated]
    start = max(sheet.n_samples // 2 - LOOKED // 2, 0)
    for t in sheet.traces():
        if t.is_input or not v.rms[t.row] > 0:
            continue
        x = sheet.stretch(t.row, start, start + LOOKED)
        moving = np.flatnonzero(x)
        if moving.size < 3 or np.ptp(x) == 0:
            continue
        key = (x * np.sign(x[moving[0]])).tobytes()
        if key in seen:
            remarks.append(
                Remark(
                    "twins",
                    f"{seen[key]}|{t.channel.name}",
                    "doubt",
                    "hold the same samples",
                    "check for a cable or column used twice",
                    t.number,
                    0.0,
                    sheet.n_samples / sheet.sample_rate,
                    {"samples": x.size},
                )
            )
        seen.setdefault(key, t.channel.name)
    return remarks
