"""Readings that look like another unit than the one written beside them."""

from __future__ import annotations

import numpy as np

from identification.recording import DERIVATIVE
from lab.checks.remark import Remark
from lab.checks.survey import Sheet, Survey

G = 9.80665
PLAUSIBLE = {"displacement": 10.0, "velocity": 1e3, "acceleration": 1e5, "force": 1e7}
"""Motion and force beyond which a test bench would not be there any more [SI]."""

OFF = 1.3
"""Factor between two readings of one motion that is no matter of noise."""


def units(survey: Survey) -> list[Remark]:
    """Counts instead of lengths, g instead of m/s², impossible sizes, and two readings of one motion that disagree."""
    remarks = []
    for sheet in survey.sheets:
        remarks += _counts(sheet) + _gravity(sheet) + _sizes(sheet) + _derivatives(sheet)
    return remarks


def _remark(sheet: Sheet, name: str, says: str, advice: str, **evidence: float) -> Remark:
    stop = sheet.n_samples / sheet.sample_rate
    return Remark("units", name, "doubt", says, advice, sheet.number, 0.0, stop, evidence)


def _counts(sheet: Sheet) -> list[Remark]:
    v = sheet.levels
    return [
        _remark(
            sheet,
            t.channel.name,
            f"all its samples are whole numbers of {t.channel.unit}, like the counts of an encoder or converter",
            "give the size of a count, and the unit it gives",
            step=float(v.step[t.row]),
        )
        for t in sheet.traces()
        if not t.is_input and v.step[t.row] == 1.0 and v.n_values[t.row] >= 8 and v.lowest[t.row] % 1 == 0
    ]


def _gravity(sheet: Sheet) -> list[Remark]:
    v = sheet.levels
    return [
        _remark(
            sheet,
            t.channel.name,
            f"rests at {v.mean[t.row]:.4g} m/s^2, as an upright accelerometer does that reads in g",
            f"multiply by {G} if its readings are in g",
            mean=float(v.mean[t.row]),
        )
        for t in sheet.traces()
        if t.channel.unit == "m/s^2" and abs(abs(v.mean[t.row]) - 1) < 0.02 and v.rms[t.row] < 0.5
    ]


def _sizes(sheet: Sheet) -> list[Remark]:
    v = sheet.levels
    return [
        _remark(
            sheet,
            t.channel.name,
            f"moves by {v.rms[t.row]:.3g} {t.channel.unit} RMS, which no test bench survives",
            "check the unit and the factor (mm for m, counts, volts)",
            rms=float(v.rms[t.row]),
        )
        for t in sheet.traces()
        if v.rms[t.row] > PLAUSIBLE.get(t.channel.quantity, np.inf)
    ]


def _derivatives(sheet: Sheet) -> list[Remark]:
    """Pairs of channels that read one degree of freedom, once as its derivative."""
    remarks = []
    moving = [
        t for t in sheet.traces() if not t.is_input and t.channel.dof and t.channel.quantity in DERIVATIVE
    ]
    for a in moving:
        for b in moving:
            order = DERIVATIVE[b.channel.quantity] - DERIVATIVE[a.channel.quantity]
            if a.channel.dof != b.channel.dof or order <= 0:
                continue
            f = sheet.lines.frequency_hz[2:-1]
            given = sheet.lines.power[a.row, 2:-1] * a.channel.factor**-2 * (2 * np.pi * f) ** (2 * order)
            read = sheet.lines.power[b.row, 2:-1] * b.channel.factor**-2
            weight = np.sqrt(given * read)
            strong = (weight > 0.05 * np.max(weight)) & (f < 0.2 * sheet.sample_rate)
            if not np.any(strong):
                continue
            ratios = read[strong] / given[strong]
            factor = float(np.sqrt(np.median(ratios)))
            # One factor for all lines, or it is no factor.
            steady = np.ptp(np.log(np.quantile(ratios, (0.25, 0.75)))) < np.log(OFF)
            if steady and not 1 / OFF < factor < OFF:
                remarks.append(
                    _remark(
                        sheet,
                        f"{a.channel.name}|{b.channel.name}",
                        f"{b.channel.name} is {factor:.4g} x what {a.channel.name} of the same place gives by differentiation",
                        "check unit and factor of both",
                        factor=factor,
                    )
                )
    return remarks
