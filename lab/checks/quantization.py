"""Channels rounded to steps that matter."""

from __future__ import annotations

import numpy as np

from lab.checks.remark import Remark
from lab.checks.survey import Survey

COARSE = 0.1
"""Step over the RMS of the channel from which on it is worth a word: rounding is then 3 % of the signal."""

MIN_VALUES = 8
"""Fewer levels than these are a command of few levels, or a channel that hardly moves."""


def quantization(survey: Survey) -> list[Remark]:
    """Outputs whose smallest step is a fair part of their motion.

    Source: Widrow and Kollár (2008), Quantization Noise, ch. 1: rounding adds noise of step / √12.
    """
    remarks = []
    for sheet in survey.sheets:
        v = sheet.levels
        for t in sheet.traces():
            step, rms = float(v.step[t.row]), float(v.rms[t.row])
            few = v.n_values[t.row] < (MIN_VALUES if t.is_input else 3)
            if step <= COARSE * rms or few or step == 0:
                continue
            noise = step / np.sqrt(12)
            remarks.append(
                Remark(
                    "quantization",
                    t.channel.name,
                    "doubt" if noise > 0.1 * rms else "note",
                    f"rounded to steps of {step:.4g} {t.channel.unit}, {step / rms:.2g} x its RMS",
                    "use a smaller range or a stronger excitation; expect noise of step / √12",
                    t.number,
                    0.0,
                    sheet.n_samples / sheet.sample_rate,
                    {"step": step, "noise_share": noise / rms},
                )
            )
    return remarks
