"""What a run is worth: errors, error bars and names held against the truth, as plain numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.recording import Array
from identification.systems import SecondOrder
from lab.diagnosis.outcome import Diagnosis
from lab.effects.effect import Effect
from lab.result import Result

Score = dict[str, Any]
"""A number, text or list of numbers by name; None where the run has nothing to say."""

MATRICES = ("mass", "damping", "stiffness")


def scored(result: Result) -> Score:
    """The errors of a result, relative to the truth, and its standard deviations likewise.

    Returns:
        For each true mode: `frequency_error`, `damping_error` (signed), `frequency_std`, `damping_std`, `mac`, None where
        it was missed; `modes_found`, the share of true modes, and `modes_extra`, how many more; `mass_error`,
        `damping_matrix_error`, `stiffness_error`, largest entry over largest entry, and `mass_covered` and so on, the share
        of entries within two standard deviations; `criteria_met`, None where the scenario has none.
    """
    comparison, truth, modes = result.comparison, result.truth_modes, result.modes
    assert comparison is not None
    assert truth is not None
    blank = [None] * len(truth)
    columns: dict[str, list[float | None]] = {
        name: list(blank)
        for name in ("frequency_error", "frequency_std", "damping_error", "damping_std", "mac")
    }
    for pair in comparison.pairs:
        i, j = pair.truth, pair.estimate
        columns["frequency_error"][i] = pair.frequency_error
        columns["frequency_std"][i] = _relative(modes.frequency_std, j, truth.frequency_hz[i])
        columns["damping_error"][i] = pair.damping_error
        columns["damping_std"][i] = _relative(modes.damping_std, j, truth.damping_ratio[i])
        columns["mac"][i] = pair.mac
    met = [criterion.passed for criterion in result.criteria]
    return {
        **columns,
        "modes_found": len(comparison.pairs) / len(truth) if len(truth) else None,
        "modes_extra": len(comparison.extra),
        "mass_error": comparison.mass_error,
        "damping_matrix_error": comparison.damping_error,
        "stiffness_error": comparison.stiffness_error,
        **_matrices_covered(result.truth_second_order, result.second_order),
        "criteria_met": all(met) if met else None,
    }


def scored_diagnosis(diagnosis: Diagnosis, hidden: Sequence[Effect], right: bool) -> Score:
    """Whether the hidden effects were named, and how far off their sizes are.

    Args:
        diagnosis: what was found.
        hidden: what there was to find.
        right: whether the verdict is the expected one.

    Returns:
        `verdict`; `verdict_right`; `named_rightly`: every hidden effect at its place and nothing else; for each parameter
        of each hidden effect, None where it was not found: `parameter_error`, relative and signed, and
        `parameter_deviation`, the error in its own standard deviations.
    """
    found = {(each.effect.cause, each.effect.location): each for each in diagnosis.findings}
    there = {(effect.cause, effect.location) for effect in hidden}
    errors: list[float | None] = []
    deviations: list[float | None] = []
    for effect in hidden:
        finding = found.get((effect.cause, effect.location))
        for name, true in effect.parameters.items():
            quantity = finding.parameters.get(name) if finding else None
            error = None if quantity is None else quantity.value - true
            errors.append(error / abs(true) if error is not None and true else None)
            deviations.append(
                error / quantity.std if error is not None and quantity and quantity.std else None
            )
    return {
        "verdict": diagnosis.verdict,
        "verdict_right": right,
        "named_rightly": set(found) == there,
        "parameter_error": errors,
        "parameter_deviation": deviations,
    }


def _relative(std: Array | None, k: int, truth: float) -> float | None:
    return None if std is None or not truth else float(std[k] / truth)


def _matrices_covered(truth: SecondOrder | None, found: SecondOrder | None) -> Score:
    covered: Score = {f"{name}_covered": None for name in ("mass", "damping_matrix", "stiffness")}
    if truth is None or found is None or set(truth.dofs) != set(found.dofs):
        return covered
    place = np.ix_(*[[truth.dofs.index(dof) for dof in found.dofs]] * 2)
    once = np.triu_indices(len(found.dofs))
    for name, matrix in zip(covered, MATRICES, strict=True):
        std = getattr(found, f"{matrix}_std")
        if std is not None:
            error = np.abs(getattr(found, matrix) - getattr(truth, matrix)[place])
            covered[name] = float(np.mean((error < 2 * std)[once]))
    return covered
