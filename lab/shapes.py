"""Mode shapes as displacements, turned to be as real as they can be, largest part 1."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.modes import Modes
from identification.recording import DERIVATIVE
from lab.result import Result


def displacement_shapes(modes: Modes) -> tuple[list[int], np.ndarray]:
    """Rows of the outputs that measure motion, and their displacement shapes, (n_rows, n_modes) complex.

    A velocity or acceleration of a mode is λ or λ² times its displacement; a channel's factor is taken out.
    """
    rows = [
        row
        for row, channel in enumerate(modes.outputs)
        if channel.quantity in DERIVATIVE and channel.factor != 0
    ]
    power = np.array([DERIVATIVE[modes.outputs[row].quantity] for row in rows], dtype=int)
    factor = np.array([modes.outputs[row].factor for row in rows], dtype=float)
    return rows, modes.shapes[rows] / factor[:, None] / modes.poles[None, :] ** power[:, None]


def aligned(shapes: np.ndarray) -> np.ndarray:
    """The same shapes (n, n_modes), each turned in phase to be as real as possible, its largest part near +1.

    The turn maximizes Σ (Re φ)²: half the phase of Σ φ², backwards.
    """
    turned = shapes * np.exp(-0.5j * np.angle(np.sum(shapes**2, axis=0)))
    if not turned.size:
        return turned
    largest = np.argmax(np.abs(turned), axis=0), np.arange(turned.shape[1])
    size = np.abs(turned[largest])
    sign = np.where(turned[largest].real < 0, -1.0, 1.0)
    return turned * (sign / np.where(size == 0, 1.0, size))


def dof_shapes(result: Result, dofs: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Displacement shapes at degrees of freedom, and which of these are known for each mode.

    M, C, K, where recovered, know degrees of freedom that only an actuator touched; otherwise the outputs
    that name a degree of freedom tell (their mean, where several do).

    Args:
        result: an identification.
        dofs: names of the degrees of freedom.

    Returns:
        Shapes (n_dofs, n_modes), complex, aligned, zero where unknown; and a mask of the same shape.
    """
    shapes = np.zeros((len(dofs), len(result.modes)), dtype=complex)
    known = np.zeros(shapes.shape, dtype=bool)
    rows, measured = displacement_shapes(result.modes)
    names = [result.modes.outputs[row].dof for row in rows]
    for i, dof in enumerate(dofs):
        own = [j for j, name in enumerate(names) if name == dof]
        if own:
            shapes[i], known[i] = measured[own].mean(axis=0), True
    if result.second_order is not None and len(result.modes):
        complete = result.second_order.modes()
        for j, frequency in enumerate(result.modes.frequency_hz):
            distance = np.abs(complete.frequency_hz - frequency)
            if not distance.size or distance.min() > 0.01 * frequency:
                continue
            full = dict(
                zip(result.second_order.dofs, complete.shapes[:, int(np.argmin(distance))], strict=True)
            )
            shapes[:, j] = [full.get(dof, 0) for dof in dofs]
            known[:, j] = [dof in full for dof in dofs]
    return aligned(shapes), known
