"""An estimate laid beside a reference: which mode is which, and how far off each number is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from identification.modes import Modes, mac
from identification.systems import SecondOrder


@dataclass(frozen=True)
class Pair:
    """A mode of the reference and the estimate that belongs to it.

    Attributes:
        truth: position among the reference modes.
        estimate: position among the estimated modes.
        frequency_error: signed, relative to the reference.
        damping_error: signed, relative to the reference.
        mac: modal assurance criterion of the two shapes.
    """

    truth: int
    estimate: int
    frequency_error: float
    damping_error: float
    mac: float


@dataclass(frozen=True)
class Comparison:
    """Paired modes, the unpaired ones, and the errors of the matrices.

    Attributes:
        pairs: by rising reference frequency.
        missed: positions of reference modes without an estimate.
        extra: positions of estimated modes without a reference.
        mass_error, damping_error, stiffness_error: largest entry error over largest entry of the reference; None where
            there are no matrices to compare.
    """

    pairs: tuple[Pair, ...]
    missed: tuple[int, ...]
    extra: tuple[int, ...]
    mass_error: float | None = None
    damping_error: float | None = None
    stiffness_error: float | None = None


def compare(
    truth: Modes,
    estimate: Modes,
    truth_matrices: SecondOrder | None = None,
    estimated_matrices: SecondOrder | None = None,
    *,
    frequency_band: float = 0.1,
) -> Comparison:
    """Modes paired one to one by the least total distance, and errors of the matrices.

    Args:
        truth: reference modes.
        estimate: estimated modes, at the same outputs.
        truth_matrices: reference M, C, K.
        estimated_matrices: estimated M, C, K; degrees of freedom are matched by name.
        frequency_band: pairs further apart than this relative frequency are no pairs.

    Returns:
        The comparison; the distance of a pair is its relative frequency difference over `frequency_band` plus 1 - MAC.
    """
    agreement = mac(truth.shapes, estimate.shapes)
    relative = np.subtract.outer(-truth.frequency_hz, -estimate.frequency_hz) / truth.frequency_hz[:, None]
    near = np.abs(relative) <= frequency_band
    cost = np.where(near, np.abs(relative) / frequency_band + (1 - agreement), 1e3)
    rows, columns = linear_sum_assignment(cost)
    pairs = tuple(
        Pair(
            int(i),
            int(j),
            float(relative[i, j]),
            float(estimate.damping_ratio[j] / truth.damping_ratio[i] - 1)
            if truth.damping_ratio[i]
            else float(estimate.damping_ratio[j] > 0) * float("inf"),
            float(agreement[i, j]),
        )
        for i, j in zip(rows, columns, strict=True)
        if near[i, j]
    )
    missed = tuple(sorted(set(range(len(truth))) - {pair.truth for pair in pairs}))
    extra = tuple(sorted(set(range(len(estimate))) - {pair.estimate for pair in pairs}))
    return Comparison(pairs, missed, extra, *matrix_errors(truth_matrices, estimated_matrices))


def matrix_errors(
    truth: SecondOrder | None, estimate: SecondOrder | None
) -> tuple[float | None, float | None, float | None]:
    """Largest entry error over largest entry, for mass, damping and stiffness; None without a common set of DOFs."""
    if truth is None or estimate is None or not set(estimate.dofs) <= set(truth.dofs):
        return None, None, None
    if len(estimate.dofs) != len(truth.dofs):
        return None, None, None
    order = [truth.dofs.index(dof) for dof in estimate.dofs]

    def error(a: np.ndarray, b: np.ndarray) -> float | None:
        reference = a[np.ix_(order, order)]
        largest = np.max(np.abs(reference))
        return float(np.max(np.abs(b - reference)) / largest) if largest else None

    return (
        error(truth.mass, estimate.mass),
        error(truth.damping, estimate.damping),
        error(truth.stiffness, estimate.stiffness),
    )
