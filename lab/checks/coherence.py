"""Outputs that the measured inputs do not explain."""

from __future__ import annotations

import numpy as np

from lab.checks.remark import Remark
from lab.checks.survey import Survey

LOW = 0.6
"""Share of an output's power that the inputs must explain."""

GOOD = 0.85
"""Mean coherence of the best twentieth of the lines, from which on low values are those of resonances that ring for
longer than a piece."""

STATIONARY = ("random",)


def coherence(survey: Survey) -> list[Remark]:
    """Outputs of which the inputs explain little, by the multiple coherence averaged over the output's power.

    The estimate is freed of its bias: n pieces and m inputs explain m / n of any noise.

    Source: Bendat and Piersol (2010), Random Data, eqs. (7.35) and (9.75).
    """
    remarks = []
    for sheet in survey.sheets:
        m, n = sheet.n_inputs, sheet.lines.n_pieces
        if not m or n < 4 * m + 8 or sheet.record.kind not in STATIONARY:
            continue
        for t, share in zip(sheet.traces()[m:], sheet.explained(), strict=True):
            column = np.sort(sheet.coherence[2:, t.row - m])
            best = float(np.mean(column[-max(column.size // 20, 1) :]))
            if not (share < LOW and best < GOOD):
                continue
            remarks.append(
                Remark(
                    "coherence",
                    t.channel.name,
                    "doubt",
                    f"the inputs explain only {100 * max(share, 0.0):.0f} % of its power (mean coherence)",
                    "look for another excitation, noise or a nonlinearity; average longer, or treat the inputs as unmeasured",
                    t.number,
                    0.0,
                    sheet.n_samples / sheet.sample_rate,
                    {"coherence": share, "averages": n},
                )
            )
    return remarks
