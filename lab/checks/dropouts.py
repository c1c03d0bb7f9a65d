"""Stretches in which a channel holds its last value while the others go on."""

from __future__ import annotations

import numpy as np

from lab.checks.remark import Remark, Trace
from lab.checks.survey import Sheet, Survey

RISK = 1e-6
MIN_STEPS = 4
"""Steps of a rounded channel by which it must move on at the end of a hold."""

MAX_LOOKED = 200
"""Holds of a channel that are looked at."""


def dropouts(survey: Survey) -> list[Remark]:
    """Outputs that stand still for some samples and then go on from where they should have been.

    Equal neighbours have the share p of all samples in a rounded signal, and n of them in a row the chance p^(n-1).
    Where all outputs stand still together, the structure rests.
    """
    remarks = []
    for sheet in survey.sheets:
        for t in sheet.traces():
            held = [] if t.is_input else _held(sheet, t)
            if not held:
                continue
            longest = max(n for _, n in held)
            total = sum(n for _, n in held)
            remarks.append(
                Remark(
                    "dropouts",
                    t.channel.name,
                    "doubt",
                    f"holds its value {len(held)} time{'s' * (len(held) > 1)}, for {longest} samples at the longest",
                    "mark these samples as missing, and check the connection and the buffer of the logger",
                    t.number,
                    held[0][0] / sheet.sample_rate,
                    (held[-1][0] + held[-1][1]) / sheet.sample_rate,
                    {"holds": len(held), "samples": total, "longest": longest},
                )
            )
    return remarks


def _held(sheet: Sheet, t: Trace) -> list[tuple[int, int]]:
    """First sample and length of each hold."""
    v = sheet.levels
    runs = v.runs[t.row]
    usual = max((v.n_repeated[t.row] - np.sum(runs[:, 1] - 1)) / v.n_samples, 1 / v.n_samples)
    if len(runs) > MAX_LOOKED:
        # So many are how this channel is: rounded, or repeated throughout.
        usual = max(v.n_repeated[t.row] / v.n_samples, usual)
    found = []
    rare = [(int(a), int(n)) for a, n in runs if v.n_samples * usual ** (n - 1) < RISK]
    for start, n in rare[:MAX_LOOKED]:
        stop = start + n
        if start == 0 or stop >= v.n_samples:
            continue
        before, held, after = sheet.stretch(t.row, start - 1, stop + 1)[[0, 1, -1]]
        at_limit = held in (v.lowest[t.row], v.highest[t.row]) and sheet.extremes[t.row].low.visits > 1
        # A structure that comes to rest slows down first.
        moved = min(abs(after - held), abs(held - before)) > max(
            MIN_STEPS * v.step[t.row], 1e-3 * v.rms[t.row]
        )
        if moved and not at_limit and _others_move(sheet, t.row, start, stop):
            found.append((start, n))
    return found


def _others_move(sheet: Sheet, row: int, start: int, stop: int) -> bool:
    """Whether another output moves all the while; true for an output that is alone."""
    others = [i for i in range(sheet.n_inputs, len(sheet.channels)) if i != row]
    if not others:
        return True
    return any(np.all(np.diff(sheet.stretch(i, start, stop)[:64]) != 0) for i in others)
