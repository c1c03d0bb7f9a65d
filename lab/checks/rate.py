"""Sample rates that are not the written ones."""

from __future__ import annotations

import numpy as np

from lab.checks.remark import Remark
from lab.checks.survey import Sheet, Survey

LOOKED = 8192
OFF = 1.15
"""Common factor of all frequencies that no nominal model is off by."""

ALIKE = 0.05
"""Scatter of that factor over the modes, relative."""


def rate(survey: Survey) -> list[Remark]:
    """Channels whose samples are repeated, and a rate at which all modes lie off the model's by one factor."""
    return [remark for sheet in survey.sheets for remark in _repeated(sheet)] + _against_model(survey)


def _repeated(sheet: Sheet) -> list[Remark]:
    remarks = []
    for t in sheet.traces():
        share = sheet.levels.n_repeated[t.row] / max(sheet.n_samples, 1)
        if t.is_input or share < 0.45:
            continue
        moves = np.flatnonzero(np.diff(sheet.stretch(t.row, 0, LOOKED)))
        gaps = np.diff(moves)
        times = int(np.min(gaps)) if gaps.size > 20 else 1
        if times > 1 and np.all(gaps == times):
            remarks.append(
                Remark(
                    "rate",
                    t.channel.name,
                    "fault",
                    f"every sample comes {times} times: its true rate is {sheet.sample_rate / times:.6g} Hz",
                    f"keep every {times}th sample, or record all channels at one rate",
                    t.number,
                    0.0,
                    sheet.n_samples / sheet.sample_rate,
                    {"repeats": times},
                )
            )
    return remarks


def _against_model(survey: Survey) -> list[Remark]:
    pairs = survey.pairs
    if pairs is None or 1 / OFF < pairs.ratio < OFF:
        return []
    if len(pairs.measured) > 1 and pairs.scatter > ALIKE:
        return []
    one = len(pairs.measured) == 1
    return [
        Remark(
            "rate",
            "",
            "doubt",
            f"{'its mode lies' if one else f'{len(pairs.measured)} modes lie'} at {pairs.ratio:.4g} x the model's frequency",
            f"if the model is right, the sample rate is {survey.recording.sample_rate / pairs.ratio:.6g} Hz; "
            "otherwise stiffness or mass is off by the square of this factor",
            0,
            0.0,
            survey.recording.duration,
            {"ratio": pairs.ratio, "modes": len(pairs.measured)},
        )
    ]
