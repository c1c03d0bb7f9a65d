"""Mains hum."""

from __future__ import annotations

import numpy as np

from lab.checks.lines import NEAR, OFF, Complex, folded
from lab.checks.remark import Remark
from lab.checks.survey import Sheet, Survey

RISK = 1e-7
"""Chance that a line of a channel without hum stands out so far."""

STEADY = 0.7
"""Share of the power at a line that one sine must hold. A resonance driven at random keeps less than 0.3."""

MIN_PIECES = 8
SHARE = 3e-3
"""Amplitude worth a word, over the RMS of the channel."""

PUSHED = 1e-4
"""Power of an input at a line, over its largest anywhere, that explains a line of the outputs."""

DRIVEN = ("sweep", "multisine", "other")


def hum(survey: Survey) -> list[Remark]:
    """Channels with a steady sine at a mains frequency or its harmonics, which no input drives.

    The transforms of consecutive pieces at the line turn evenly under a sine. Their best common turn has a power
    that is exponentially distributed about that of the neighbouring lines where there is no sine.

    Source: Thomson (1982), Proc. IEEE 70, 1055-1096, section XIII, for a sine in a coloured background.
    """
    remarks = []
    for sheet in survey.sheets:
        if sheet.lines.n_pieces < MIN_PIECES:
            continue
        for line, near in sheet.lines.mains.items():
            found = [_amplitude(near[row]) for row in range(len(sheet.channels))]
            driven = sheet.record.kind in DRIVEN and _pushed(sheet, line)
            for t in sheet.traces():
                amplitude, rms = found[t.row], float(sheet.levels.rms[t.row])
                if driven or amplitude <= SHARE * rms:
                    continue
                seen = folded(line, sheet.sample_rate)
                where = f"{line:g} Hz" if seen == line else f"{seen:g} Hz (folded from {line:g} Hz)"
                remarks.append(
                    Remark(
                        "hum",
                        t.channel.name,
                        "doubt",
                        f"hum at {where} of {amplitude:.3g} {t.channel.unit} ({amplitude / rms:.2g} x RMS)",
                        "check shields and ground loops, and take no mode at this frequency for real",
                        t.number,
                        0.0,
                        sheet.n_samples / sheet.sample_rate,
                        {"frequency_hz": line, "amplitude": amplitude},
                    )
                )
    return _strongest(remarks)


def _pushed(sheet: Sheet, line: float) -> bool:
    """Whether an input has power at a line."""
    k = round(folded(line, sheet.sample_rate) * sheet.lines.length / sheet.sample_rate)
    power = sheet.lines.power[: sheet.n_inputs]
    return bool(np.any(np.max(power[:, k - 2 : k + 3], axis=1) > PUSHED * np.max(power, axis=1)))


def _amplitude(near: Complex) -> float:
    """Amplitude of a steady sine at the middle bin, 0 when there is none; pieces in rows, bins in columns."""
    sides = np.abs(np.arange(-NEAR, NEAR + 1)) > OFF
    usual = float(np.mean(np.abs(near[:, sides]) ** 2))
    a = near[:, NEAR]
    n = a.size
    turned = np.abs(np.fft.fft(a, 4 * n)) ** 2 / n
    power = float(np.sum(np.abs(a) ** 2))
    threshold = np.log(4 * n / RISK)
    best = float(np.max(turned))
    # A sine between two bins shows in both of them, a little lower.
    steady = power > 0 and best > STEADY * power
    return float(np.sqrt(best / n)) if steady and best > threshold * usual else 0.0


def _strongest(remarks: list[Remark]) -> list[Remark]:
    """For each channel and record the strongest line, with the number of lines found."""
    best: dict[tuple[str, int], list[Remark]] = {}
    for remark in remarks:
        best.setdefault((remark.channel, remark.record), []).append(remark)
    return [max(each, key=lambda r: r.evidence["amplitude"]) for each in best.values()]
