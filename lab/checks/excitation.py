"""Resonances that no input drives."""

from __future__ import annotations

import numpy as np
import scipy.fft

from identification.peaks import find_peaks
from identification.recording import Array
from lab.checks.hum import hum
from lab.checks.lines import folded
from lab.checks.remark import Remark
from lab.checks.survey import Sheet, Survey

WEAK = 1e-4
"""Power of an input at a resonance, over its largest anywhere, that counts as none: -40 dB."""

RISE = 10.0
"""Factor by which the outputs' power rises to a resonance and falls behind it; scatter of averages stays below."""

TRANSIENT = ("pulse", "impact", "burst_random", "sweep")
MAX_WHOLE = 1 << 22


def excitation(survey: Survey) -> list[Remark]:
    """Peaks of the outputs, or modes of the model, at which every input is weaker than its best by 40 dB."""
    remarks = []
    for sheet in survey.sheets:
        if (
            not sheet.n_inputs
            or not sheet.lines.n_pieces
            or sheet.record.kind in ("ambient", "free_decay", "other")
        ):
            continue
        drive = _drive(sheet)
        undriven = [f for f in _resonances(survey, sheet) if _level(sheet, drive, f) < WEAK]
        if not undriven:
            continue
        strong = sheet.lines.frequency_hz[drive > WEAK]
        listed = ", ".join(f"{f:.4g}" for f in undriven[:6]) + ", …" * (len(undriven) > 6)
        remarks.append(
            Remark(
                "excitation",
                "|".join(channel.name for channel in sheet.channels[: sheet.n_inputs]),
                "doubt",
                f"hardly excites the resonance{'s' * (len(undriven) > 1)} at {listed} Hz",
                f"widen its band ({strong[0]:.3g} to {strong[-1]:.3g} Hz now) or use a harder hammer tip",
                sheet.number,
                0.0,
                sheet.n_samples / sheet.sample_rate,
                {"undriven": len(undriven), "lowest_hz": undriven[0], "highest_hz": undriven[-1]},
            )
        )
    return remarks


def _drive(sheet: Sheet) -> Array:
    """Power of the inputs, line by line, the strongest of them over its own maximum."""
    power = sheet.lines.power[: sheet.n_inputs]
    if sheet.record.kind in TRANSIENT and sheet.n_samples <= MAX_WHOLE:
        # A window would hide a blow at the start of a piece.
        U = scipy.fft.rfft(np.nan_to_num(np.asarray(sheet.record.inputs[:, :], dtype=float)))
        edges = np.linspace(0, U.shape[1], power.shape[1] + 1).astype(int)[:-1]
        power = np.maximum.reduceat(np.abs(U) ** 2, edges, axis=1)
    top = np.max(power, axis=1, keepdims=True)
    return np.asarray(np.max(np.divide(power, top, out=np.zeros_like(power), where=top > 0), axis=0))


def _resonances(survey: Survey, sheet: Sheet) -> list[float]:
    f, power = sheet.lines.frequency_hz, sheet.lines.power[sheet.n_inputs :]
    if survey.rig is not None:
        modes = survey.rig.modes()
        seen = np.any(np.abs(modes.shapes) > 0, axis=0) & (modes.frequency_hz < 0.4 * sheet.sample_rate)
        return [float(each) for each in modes.frequency_hz[seen]]
    total = power.sum(axis=1, keepdims=True)
    mean = np.sum(np.divide(power, total, out=np.zeros_like(power), where=total > 0), axis=0)
    humming = {remark.evidence["frequency_hz"] for remark in hum(survey)}
    tops = [peak.top for peak in find_peaks(mean[2:], RISE)]
    return [
        float(f[k + 2])
        for k in tops
        if not any(abs(f[k + 2] - folded(line, sheet.sample_rate)) < 2 * f[1] for line in humming)
        and mean[k + 2] > 1e-2 * np.max(mean)
    ]


def _level(sheet: Sheet, drive: Array, frequency_hz: float) -> float:
    """Drive at a frequency and the lines next to it."""
    k = round(frequency_hz * sheet.lines.length / sheet.sample_rate)
    return float(np.max(drive[max(k - 1, 0) : k + 2], initial=0.0))
