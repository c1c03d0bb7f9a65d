"""Channels that run into a limit."""

from __future__ import annotations

from lab.checks.extremes import End
from lab.checks.levels import Levels
from lab.checks.remark import Remark
from lab.checks.survey import Survey

PILE = 3.5
"""Samples at the limit over those at any value next to it. The round top of a slow, coarsely rounded sine reaches
(√2 - 1)⁻¹ = 2.4, and any density that falls towards its end, as the Gaussian one, less than one."""

PASSING = 0.01
"""Samples in the last twentieth of the range before the limit, over those at the limit. A sine cut at a fifth of its
amplitude still has as many."""

MIN_SAMPLES = 8
MIN_VISITS = 3


def clipping(survey: Survey) -> list[Remark]:
    """Channels that stay at one and the same extreme value, again and again.

    A level where the record begins or which holds most of it is rest, not a limit; a signal of few levels, such as a
    square wave, has as many samples at the next level.
    """
    remarks = []
    for sheet in survey.sheets:
        v = sheet.levels
        for t in sheet.traces():
            first = float(sheet.stretch(t.row, 0, 1)[0])
            for end in (sheet.extremes[t.row].high, sheet.extremes[t.row].low):
                if not _clipped(end, first, v, t.row):
                    continue
                remarks.append(
                    Remark(
                        "clipping",
                        t.channel.name,
                        "fault",
                        f"stops at {end.level:.6g} {t.channel.unit}, {end.count} samples in {end.visits} visits",
                        "choose a larger range or a weaker excitation, and leave these stretches out",
                        t.number,
                        end.first / sheet.sample_rate,
                        (end.last + 1) / sheet.sample_rate,
                        {"level": end.level, "samples": end.count, "visits": end.visits},
                    )
                )
    return remarks


def _clipped(end: End, first: float, v: Levels, row: int) -> bool:
    if end.count < MIN_SAMPLES or end.visits < MIN_VISITS or end.level == first:
        return False
    at_rest = end.count > 0.5 * v.n_samples
    # A switched level is reached without passing by.
    switched = end.near < PASSING * end.count
    away = abs(end.level - v.mean[row]) > 0.5 * v.rms[row]
    return away and not at_rest and not switched and end.count > PILE * max(end.next_count, 1)
