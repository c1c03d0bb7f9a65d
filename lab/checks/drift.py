"""Levels that wander slowly."""

from __future__ import annotations

import numpy as np
import scipy.fft
import scipy.stats

from identification.recording import Array
from lab.checks.jumps import level_jumps
from lab.checks.remark import Remark
from lab.checks.survey import Survey

SLOWEST = 2
"""Cosines of half a period and one period over the record: what a drift is made of."""

COMPARED = 24
"""Cosines after those, whose scatter a drift must stand out from."""

RISK = 1e-6
"""Chance that a channel without drift is called drifting."""

SHARE = 0.2
"""Peak-to-peak drift worth a word, over the RMS of the channel."""


def drift(survey: Survey) -> list[Remark]:
    """Outputs whose mean moves more over the record than the inputs and the motion at low frequency explain.

    The amplitudes of cosines of j half periods over the record are independent with equal variances for j up to
    where the spectrum of the signal is flat, whatever its colour; a decaying oscillation feeds them alike. Those of
    the outputs are freed of what those of the inputs explain, and the first two are held against the others.

    Source: Müller (2007), J. Econometrics 141, 1331-1352; Lazarus, Lewis, Stock and Watson (2018), J. Bus. Econ.
        Stat. 36, 541-559, section 3 (the cosine estimate of the variance at frequency zero).
    """
    remarks = []
    for sheet in survey.sheets:
        cells = sheet.levels.cells
        if cells.shape[1] < 4 * (SLOWEST + COMPARED):
            continue
        U = _cosines(cells[: sheet.n_inputs])
        for t in sheet.traces():
            if t.is_input or not sheet.levels.rms[t.row] > 0:
                continue
            cell = cells[t.row]
            if level_jumps(sheet, t.row):
                continue  # told already
            chance, slow = _chance(_cosines(cell[None])[0], U)
            size = float(np.ptp(_wave(slow, cell.size)))
            if chance > RISK or size < SHARE * sheet.levels.rms[t.row]:
                continue
            remarks.append(
                Remark(
                    "drift",
                    t.channel.name,
                    "doubt",
                    f"drifts by {size:.3g} {t.channel.unit} ({size / sheet.levels.rms[t.row]:.2g} x RMS) over the record",
                    "let the sensor warm up, or take the trend out with a high-pass before the analysis",
                    t.number,
                    0.0,
                    sheet.n_samples / sheet.sample_rate,
                    {"drift": size, "chance": chance},
                )
            )
    return remarks


def _cosines(cells: Array) -> Array:
    """Amplitudes of the slowest cosines of each row, the mean left out, shape (n_rows, SLOWEST + COMPARED)."""
    filled = (
        np.where(np.isfinite(cells), cells, np.nanmean(cells, axis=1, keepdims=True)) if cells.size else cells
    )
    if not len(filled):
        return np.zeros((0, SLOWEST + COMPARED))
    return np.asarray(scipy.fft.dct(filled, norm="ortho")[:, 1 : 1 + SLOWEST + COMPARED])


def _chance(y: Array, U: Array) -> tuple[float, Array]:
    """Chance of so large first cosines under no drift, and what they hold beyond the inputs."""
    moving = U[np.any(U != 0, axis=1)]
    gain = np.linalg.lstsq(moving[:, SLOWEST:].T, y[SLOWEST:], rcond=None)[0]
    beyond = y - gain @ moving
    free = COMPARED - len(moving)
    rest = float(beyond[SLOWEST:] @ beyond[SLOWEST:])
    if free < 4 or rest <= 0:
        return 1.0, beyond[:SLOWEST]
    # The gain is uncertain, which widens what it foretells.
    X, X0 = moving[:, SLOWEST:].T, moving[:, :SLOWEST].T
    spread = np.eye(SLOWEST) + X0 @ np.linalg.pinv(X.T @ X) @ X0.T
    d = beyond[:SLOWEST]
    F = float(d @ np.linalg.solve(spread, d)) / SLOWEST / (rest / free)
    return float(scipy.stats.f.sf(F, SLOWEST, free)), d


def _wave(slow: Array, n: int) -> Array:
    """The drift itself, at n cells."""
    amplitudes = np.zeros(n)
    amplitudes[1 : 1 + slow.size] = slow
    return np.asarray(scipy.fft.idct(amplitudes, norm="ortho"))
