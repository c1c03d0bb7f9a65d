"""Outputs that the measured inputs do not explain."""

from __future__ import annotations

import numpy as np

from identification.recording import Array
from lab.checks.remark import Remark
from lab.checks.survey import Sheet, Survey

LOW = 0.6
"""Share of an output's power that the inputs must explain."""

STATIONARY = ("random", "multisine")


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
        for t, share in zip(sheet.traces()[m:], explained(sheet), strict=True):
            if not share < LOW:
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


def explained(sheet: Sheet) -> Array:
    """Share of each output's power that the inputs explain, shape (n_outputs,); NaN for a silent one."""
    m, n = sheet.n_inputs, sheet.lines.n_pieces
    uu, yu = sheet.lines.cross[:, :m], sheet.lines.cross[:, m:]
    yy = sheet.lines.power[m:].T
    inverse = np.linalg.pinv(uu, rcond=1e-10, hermitian=True)
    told = np.einsum("fyu,fuv,fyv->fy", yu, inverse, yu.conj()).real
    # The lowest lines hold what the window leaves of the mean.
    total, part = yy[2:].sum(axis=0), told[2:].sum(axis=0)
    share = np.divide(part, total, out=np.full(total.size, np.nan), where=total > 0)
    return np.asarray(1 - (1 - share) * n / (n - m))
