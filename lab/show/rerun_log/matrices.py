"""Matrices as heat maps with their numbers: M, C, K found, true and their difference; the MAC."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from identification.modes import mac
from lab.result import Result
from lab.show.drawing import diverging, sequential
from lab.show.rerun_log.plot import log_texts
from lab.show.shapes import within_reach
from lab.show.tables import MATRICES, same_dofs

LUMA = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue in brightness (Rec. ITU-R BT.601)."""
MAX_NUMBERED = 12
"""Matrices up to this size carry their numbers."""


def log_matrices(stream: rr.RecordingStream, result: Result) -> list[rrb.View]:
    """Logs M, C, K as found and, where known, true and the difference; one view each, a row per matrix."""
    found = result.second_order
    if found is None:
        return []
    truth = same_dofs(result.truth_second_order, found.dofs)
    views = []
    for name, letter, unit in MATRICES:
        value = getattr(found, name)
        reference = None if truth is None else getattr(truth, name)
        limit = float(np.max(np.abs(value if reference is None else [value, reference])))
        shown = [("recovered", value, limit)]
        if reference is not None:
            off = value - reference
            shown += [("true", reference, limit), ("difference", off, float(np.max(np.abs(off))))]
        for what, matrix, largest in shown:
            form = {"digits": 2, "step": 1} if what == "difference" else {"digits": 4, "step": 3}
            numbers, scale = scaled(matrix, largest, **form)
            origin = f"/matrices/{name}/{what}"
            _log_heat(stream, origin, diverging(matrix, largest), numbers, found.dofs, found.dofs)
            views.append(_heat_view(origin, f"{letter} {what} [{scale}{unit}]", matrix.shape))
    return views


def scaled(matrix: np.ndarray, largest: float, *, digits: int, step: int) -> tuple[list[str], str]:
    """Entries as short numbers, row by row, and the power of ten (a multiple of `step`) that was taken out.

    The largest entry shows `digits` significant digits, all entries the same decimals.
    """
    if largest == 0 or not np.isfinite(largest):
        return [f"{v:g}" for v in matrix.ravel()], ""
    exponent = int(np.floor(np.log10(largest)))
    power = step * (exponent // step) if not -1 <= exponent <= 3 else 0
    decimals = max(0, digits - 1 - (exponent - power))
    # Adding zero turns "-0.0" into "0.0".
    numbers = [f"{round(float(v) / 10.0**power, decimals) + 0.0:.{decimals}f}" for v in matrix.ravel()]
    return numbers, f"1e{power} " if power else ""


def log_mac(stream: rr.RecordingStream, result: Result) -> list[rrb.View]:
    """Logs the MAC of the identified modes among themselves and against the truth; one view each."""
    modes, truth = result.modes, result.truth_modes
    if not len(modes):
        return []
    pairs = [("itself", modes, "MAC of the identified modes")]
    if truth is not None and len(truth):
        pairs.insert(0, ("truth", within_reach(truth, modes), "MAC: identified (rows), true (columns)"))
    views = []
    for name, other, title in pairs:
        value = mac(modes.shapes, other.shapes)
        rows, columns = ([f"{f:.4g}" for f in m.frequency_hz] for m in (modes, other))
        numbers = [f"{v:.2f}" for v in value.ravel()]
        _log_heat(stream, f"/mac/{name}", sequential(value), numbers, rows, columns)
        views.append(_heat_view(f"/mac/{name}", f"{title} [Hz]", value.shape))
    return views


def _log_heat(
    stream: rr.RecordingStream,
    origin: str,
    colors: np.ndarray,
    numbers: list[str],
    rows: Sequence[str],
    columns: Sequence[str],
) -> None:
    """A picture with one pixel per entry, its numbers on it and the names of rows and columns beside it."""
    image = rr.Image(colors, color_model="RGB", magnification_filter="nearest")
    stream.log(origin, image, static=True)
    n, m = colors.shape[:2]
    if max(n, m) > MAX_NUMBERED:
        return
    # The viewer writes a label a little below its point.
    x, y = np.meshgrid(np.arange(m) + 0.5, np.arange(n) + 0.4)
    # The viewer writes on a dark glass: black shows on that before a light colour, white before a dark one.
    light = colors.reshape(-1, 3) @ LUMA > 150
    inks = np.where(light[:, None], (0, 0, 0), (255, 255, 255)).astype(np.uint8)
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    log_texts(stream, f"{origin}/numbers", places, numbers, inks=inks)
    left = np.stack([np.full(n, -0.3), np.arange(n) + 0.4], axis=1)
    above = np.stack([np.arange(m) + 0.5, np.full(m, -0.4)], axis=1)
    log_texts(stream, f"{origin}/names", np.concatenate([left, above]), [*rows, *columns])


def _heat_view(origin: str, name: str, shape: tuple[int, ...]) -> rrb.View:
    bounds = rrb.VisualBounds2D(x_range=(-0.8, shape[1] + 0.1), y_range=(-0.7, shape[0] + 0.1))
    return rrb.Spatial2DView(origin=origin, name=name, visual_bounds=bounds)
