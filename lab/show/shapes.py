"""Mode shapes ready to be drawn: which of them, and beside which true ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.modes import Modes
from lab.result import Result
from lab.shapes import aligned, displacement_shapes, dof_shapes


def shown_modes(result: Result, n_most: int) -> list[int]:
    """Positions of at most `n_most` modes by rising frequency, those first that stay put over the model orders."""
    stable_first = sorted(range(len(result.modes)), key=lambda i: not result.stable[i])
    return sorted(stable_first[:n_most])


def within_reach(truth: Modes, modes: Modes) -> Modes:
    """The modes of the truth up to a little above the highest identified one: what a test could have found."""
    top = 1.1 * float(np.max(modes.frequency_hz, initial=0.0))
    near = truth.frequency_hz <= top
    return truth.take(near) if near.any() else truth


@dataclass(frozen=True, eq=False)
class ShapeTable:
    """Displacement shapes of identified modes, and of their true partners, at the same points.

    Attributes:
        labels: names of the points: degrees of freedom where M, C, K were recovered, else output channels.
        estimate: aligned shapes, (n_points, n_modes) complex.
        truth: likewise, scaled to fit the estimate; NaN where a mode has no partner.
    """

    labels: tuple[str, ...]
    estimate: np.ndarray
    truth: np.ndarray


def shape_table(result: Result) -> ShapeTable:
    """The most complete displacement shapes that the result offers."""
    labels, estimate, truth_at = _measured(result) if result.second_order is None else _recovered(result)
    estimate = aligned(estimate)
    truth = np.full(estimate.shape, np.nan, dtype=complex)
    for pair in result.comparison.pairs if result.comparison else ():
        if truth_at is None:
            break
        t, e = truth_at[:, pair.truth], estimate[:, pair.estimate]
        power = np.vdot(t, t).real
        truth[:, pair.estimate] = t * (np.vdot(t, e) / power if power else 1.0)
    return ShapeTable(labels, estimate, truth)


def _measured(result: Result) -> tuple[tuple[str, ...], np.ndarray, np.ndarray | None]:
    rows, estimate = displacement_shapes(result.modes)
    truth = None if result.truth_modes is None else displacement_shapes(result.truth_modes)[1]
    return tuple(result.modes.outputs[row].name for row in rows), estimate, truth


def _recovered(result: Result) -> tuple[tuple[str, ...], np.ndarray, np.ndarray | None]:
    assert result.second_order is not None
    dofs = result.second_order.dofs
    estimate, _ = dof_shapes(result, dofs)
    if result.truth_second_order is None or result.truth_modes is None:
        return dofs, estimate, None
    if not set(dofs) <= set(result.truth_second_order.dofs):
        return dofs, estimate, None
    rows = [result.truth_second_order.dofs.index(dof) for dof in dofs]
    complete = result.truth_second_order.modes()
    nearest = [int(np.argmin(np.abs(complete.frequency_hz - f))) for f in result.truth_modes.frequency_hz]
    return dofs, estimate, complete.shapes[rows][:, nearest]
