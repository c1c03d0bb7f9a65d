"""Tables of the report as rows of text: criteria, modes, and matrices beside the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.systems import SecondOrder
from lab.result import Criterion, Result, Validation
from lab.show.verdict import bound, lowered, mode_rows, percent, words

MAX_PRINTED = 12
"""Matrices up to this size are printed, larger ones drawn."""
MATRICES = (("mass", "M", "kg"), ("damping", "C", "N s/m"), ("stiffness", "K", "N/m"))


@dataclass(frozen=True)
class CriterionRow:
    """One requirement in words."""

    name: str
    bound: str
    value: str
    outcome: str


@dataclass(frozen=True)
class ModesTable:
    """Heads and rows of the table of modes, and what it says below its title."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str


@dataclass(frozen=True)
class Grid:
    """One matrix as text."""

    name: str
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class MatrixTables:
    """One matrix: found, and where known its standard deviation, the truth and the difference."""

    name: str
    tables: tuple[Grid, ...]


def criteria_rows(result: Result) -> list[CriterionRow]:
    """Every requirement with what was reached."""
    return [
        CriterionRow(
            words(criterion.name),
            bound(criterion),
            _reached(criterion),
            "passed" if criterion.passed else "FAILED",
        )
        for criterion in result.criteria
    ]


@dataclass(frozen=True)
class ValidationRow:
    """One criterion of the field in words."""

    name: str
    bound: str
    value: str
    outcome: str
    where: str
    source: str


def validation_rows(result: Result) -> list[ValidationRow]:
    """Every criterion of the field with what was reached and how it came out."""
    return [
        ValidationRow(
            each.name,
            f"{'≥' if each.at_least else '≤'} {_quantity(each, each.limit)}",
            "not available" if each.value is None else _quantity(each, each.value, each.std),
            each.outcome if each.outcome != "fail" else "FAIL",
            each.where,
            each.source,
        )
        for each in result.validation
    ]


def _quantity(each: Validation, value: float, std: float | None = None) -> str:
    """Errors in percent, all else as numbers; what must reach a bound is never rounded up to it."""
    if "error of" in each.name:
        bar = "" if std is None or not std > 0 else f" ± {percent(std)}"
        return f"{percent(value)}{bar}"
    return lowered(value) if each.at_least and value != each.limit else f"{value:.3g}"


def _reached(criterion: Criterion) -> str:
    if criterion.value is None:
        return "not available"
    return lowered(criterion.value) if criterion.name == "mac" else f"{criterion.value:.4g}"


def modes_table(result: Result) -> ModesTable:
    """The modes with their standard deviations, beside the truth where there is one."""
    compared = result.comparison is not None and result.truth_modes is not None
    mixed = result.stabilization is not None and not all(result.stable)
    heads = ["Mode", "Frequency [Hz]", "Damping [%]"]
    if mixed:
        heads.append("Stable")
    if compared:
        heads += ["True [Hz]", "Error", "True [%]", "Error", "MAC"]
    rows = []
    for row in mode_rows(result):
        cells = ["missed" if row.number is None else str(row.number)]
        cells += [with_std(row.frequency, row.frequency_std), with_std(row.damping, row.damping_std, 100.0)]
        if mixed:
            cells.append("" if row.stable is None else "yes" if row.stable else "no")
        if compared:
            cells += [
                with_std(row.true_frequency, None),
                relative(row.frequency_error),
                with_std(row.true_damping, None, 100.0),
                relative(row.damping_error),
                "" if row.mac is None else f"{math.floor(row.mac * 1e6 + 1e-6) / 1e6:.6f}",
            ]
        rows.append(tuple(cells))
    parts = []
    if result.stabilization is not None and not mixed:
        parts.append("All modes are stable over the model orders.")
    if result.modes.frequency_std is not None:
        over = "" if result.stabilization is None else " of the scatter over the model orders"
        parts.append(f"± one standard deviation{over}.")
    if compared:
        parts.append("Errors are relative to the truth.")
    return ModesTable(tuple(heads), tuple(rows), " ".join(parts))


def with_std(value: float | None, std: float | None, scale: float = 1.0) -> str:
    """A value to the digits that its standard deviation supports (two of its own), else to six."""
    if value is None:
        return ""
    value *= scale
    if std is None or not math.isfinite(std):
        return f"{value:#.6g}"
    std *= scale
    if std <= 1e-4 * abs(value):
        return f"{value:#.6g} ± {std:.1e}"
    decimals = max(0, 1 - math.floor(math.log10(std)))
    return f"{value:.{decimals}f} ± {std:.{decimals}f}"


def relative(error: float | None) -> str:
    """A relative error in scientific notation; undefined where the truth is zero."""
    if error is None:
        return ""
    return f"{error:+.1e}" if math.isfinite(error) else "undefined"


def same_dofs(truth: SecondOrder | None, dofs: Sequence[str]) -> SecondOrder | None:
    """The true matrices in the order of `dofs`; None where they are of other degrees of freedom."""
    if truth is None or set(truth.dofs) != set(dofs):
        return None
    take = np.ix_(*[[truth.dofs.index(dof) for dof in dofs]] * 2)
    return SecondOrder(truth.mass[take], truth.damping[take], truth.stiffness[take], tuple(dofs))


def matrix_summary(found: SecondOrder, truth: SecondOrder) -> list[tuple[str, ...]]:
    """Per matrix: largest true entry, largest difference and where it sits, and the ratio of both."""
    rows: list[tuple[str, ...]] = []
    for name, letter, unit in MATRICES:
        reference = getattr(truth, name)
        off = np.abs(getattr(found, name) - reference)
        i, j = (int(k) for k in np.unravel_index(np.argmax(off), off.shape))
        largest = float(np.max(np.abs(reference)))
        ratio = f"{off[i, j] / largest:.1e}" if largest else "undefined"
        where = f"{off[i, j]:.1e} at {found.dofs[i]}, {found.dofs[j]}"
        rows.append((f"{letter} [{unit}]", f"{largest:.6g}", where, ratio))
    return rows


def matrix_tables(found: SecondOrder, truth: SecondOrder | None) -> list[MatrixTables]:
    """M, C and K entry by entry: ten digits and the truth beside them where there is room, else fewer."""
    n = len(found.dofs)
    digits = 10 if n <= 4 else 7 if n <= 8 else 5
    tables = []
    for name, letter, unit in MATRICES:
        value, std = getattr(found, name), getattr(found, f"{name}_std")
        grids = [Grid("recovered", fixed(value, digits))]
        if std is not None:
            grids.append(Grid("standard deviation", scientific(std)))
        if truth is not None:
            reference = getattr(truth, name)
            if n <= 4:
                grids.append(Grid("true", fixed(reference, digits)))
            grids.append(Grid("recovered - true", scientific(value - reference)))
        tables.append(MatrixTables(f"{letter} [{unit}]", tuple(grids)))
    return tables


def fixed(matrix: np.ndarray, digits: int) -> tuple[tuple[str, ...], ...]:
    """Entries with the same decimals, so many that the largest has `digits` significant ones."""
    largest = float(np.max(np.abs(matrix), initial=0.0))
    decimals = max(0, digits - 1 - math.floor(math.log10(largest))) if largest > 0 else 1
    if largest > 0 and decimals > digits + 3:
        return tuple(tuple(f"{v:.{digits - 1}e}" for v in row) for row in matrix)
    # Adding zero turns "-0.0" into "0.0".
    return tuple(tuple(f"{round(float(v), decimals) + 0.0:.{decimals}f}" for v in row) for row in matrix)


def scientific(matrix: np.ndarray) -> tuple[tuple[str, ...], ...]:
    """Entries with two significant digits."""
    return tuple(tuple("0" if v == 0 else f"{v:.1e}" for v in row) for row in matrix)
