"""Channels on which nothing happens."""

from __future__ import annotations

from lab.checks.remark import Remark
from lab.checks.survey import Survey


def dead(survey: Survey) -> list[Remark]:
    """Channels that keep one value, in the records in which an output moves at all."""
    remarks = []
    for sheet in survey.sheets:
        v = sheet.levels
        still = ~(v.highest > v.lowest)
        for t in sheet.traces():
            # A force is at rest in the records that drive another place.
            elsewhere = t.is_input and not still[: sheet.n_inputs].all() and _moves_elsewhere(survey, t.row)
            if not still[t.row] or elsewhere or v.n_missing[t.row] == sheet.n_samples:
                continue
            remarks.append(
                Remark(
                    "dead",
                    t.channel.name,
                    "fault",
                    f"never moves: every sample is {v.mean[t.row]:.6g} {t.channel.unit}",
                    "check cable and sensor, or leave the channel out",
                    t.number,
                    0.0,
                    sheet.n_samples / sheet.sample_rate,
                    {"value": float(v.mean[t.row])},
                )
            )
    return remarks


def _moves_elsewhere(survey: Survey, row: int) -> bool:
    sheets = [sheet for sheet in survey.sheets if row < sheet.n_inputs]
    return any(sheet.levels.highest[row] > sheet.levels.lowest[row] for sheet in sheets)
