"""One screen that tells what a test came to."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Sequence

import numpy as np

from identification.recording import Array
from lab.result import Result, Validation

MAX_DOFS = 8
"""Matrices up to this size are printed entry by entry."""

MAX_MODES = 20
WIDTH = 100


def summary(result: Result) -> str:
    """Matrices with their errors, modes beside the true ones, criteria, validation and warnings, as lines of text."""
    parts = [_headline(result), _matrices(result), _modes(result), _criteria(result), _validation(result)]
    parts += [textwrap.fill(result.explanation or " ".join(result.notes), WIDTH)]
    parts += ["\n".join(textwrap.fill(f"warning: {each}", WIDTH) for each in result.warnings)]
    return "\n\n".join(part for part in parts if part)


def _headline(result: Result) -> str:
    found = result.realization
    rate = (
        f"sampled at {result.sample_rate:g} Hz" if np.isfinite(result.sample_rate) else "continuous in time"
    )
    return f"{result.title}\n{found.method}, order {found.order}, {rate}".lstrip("\n")


def _matrices(result: Result) -> str:
    estimate = result.second_order
    if estimate is None:
        return ""
    named = (
        ("M [kg]", estimate.mass, estimate.mass_std, "mass_error"),
        ("C [N s/m]", estimate.damping, estimate.damping_std, "damping_error"),
        ("K [N/m]", estimate.stiffness, estimate.stiffness_std, "stiffness_error"),
    )
    blocks = []
    for name, matrix, std, error in named:
        value = getattr(result.comparison, error) if result.comparison else None
        off = "" if value is None else f"   largest error / largest entry {value:.1e}"
        rows = _rows(matrix, std, estimate.dofs) if len(estimate.dofs) <= MAX_DOFS else []
        blocks.append("\n".join([name + off, *rows]))
    return "\n".join(blocks)


def _rows(matrix: Array, std: Array | None, dofs: Sequence[str]) -> list[str]:
    size = float(np.max(np.abs(matrix)))
    # Entries below the printed digits of the largest one are rounding, not information.
    shown = np.where(np.abs(matrix) < 1e-10 * size, 0.0, matrix)
    width = max(len(dof) for dof in dofs)
    digits = _digits(std, size, room=10 if len(dofs) <= 5 else 5)
    return [
        f"  {dof:<{width}}" + "".join(f" {value:>{digits + 6}.{digits}g}" for value in row)
        for dof, row in zip(dofs, shown, strict=True)
    ]


def _digits(std: Array | None, size: float, *, room: int) -> int:
    """Digits of the largest entry that the standard deviations support, two of their own, as far as there is room."""
    if std is None or not np.all(np.isfinite(std)):
        return min(6, room)
    least = float(np.min(std))
    return room if least <= 1e-10 * size else int(np.clip(np.ceil(np.log10(size / least)) + 2, 3, room))


def _modes(result: Result) -> str:
    modes = result.modes
    if not len(modes):
        return "no mode found"
    pairs = {pair.estimate: pair for pair in result.comparison.pairs} if result.comparison else {}
    frequencies = _with_bars(modes.frequency_hz, modes.frequency_std, "Hz", 5)
    dampings = _with_bars(100 * modes.damping_ratio, modes.damping_std, "damping %", 4, factor=100)
    head = f"{'mode':>4} {frequencies[0]} {dampings[0]} {'stable':>6}"
    if result.comparison:
        head += f" {'true Hz':>10} {'Hz error':>9} {'true %':>8} {'damp. err':>9} {'MAC':>8}"
    lines = [head]
    for k in range(min(len(modes), MAX_MODES)):
        stable = "yes" if result.stable[k] else "no"
        line = f"{k + 1:>4} {frequencies[k + 1]} {dampings[k + 1]} {stable:>6}"
        if k in pairs and result.truth_modes is not None:
            pair, truth = pairs[k], result.truth_modes
            line += (
                f" {truth.frequency_hz[pair.truth]:>10.5g} {pair.frequency_error:>9.1e}"
                f" {100 * truth.damping_ratio[pair.truth]:>8.4g} {pair.damping_error:>9.1e} {pair.mac:>8.5f}"
            )
        lines.append(line)
    if len(modes) > MAX_MODES:
        lines.append(f"     and {len(modes) - MAX_MODES} more")
    if result.comparison and result.truth_modes is not None:
        n_missed = len(result.comparison.missed)
        lines.append(
            f"     {len(result.truth_modes) - n_missed} of {len(result.truth_modes)} true modes found"
        )
    return "\n".join(lines)


def _with_bars(values: Array, std: Array | None, head: str, digits: int, *, factor: float = 1.0) -> list[str]:
    """A column with its heading, and beside it one standard deviation where that is known."""
    cells = [f"{head:>10}", *(f"{value:>10.{digits}g}" for value in values)]
    if std is None:
        return cells
    bars = [f"{'±':>7}", *(f"{factor * each:>7.2g}" for each in std)]
    return [f"{cell} {bar}" for cell, bar in zip(cells, bars, strict=True)]


def _criteria(result: Result) -> str:
    lines = []
    for criterion in result.criteria:
        value = "not available" if criterion.value is None else f"{criterion.value:.3g}"
        verdict = "met   " if criterion.passed else "MISSED"
        lines.append(f"  {verdict} {criterion.name}: {value} (limit {criterion.limit:g})")
    return "\n".join(["criteria", *lines]) if lines else ""


def _validation(result: Result) -> str:
    """How the criteria of the field came out, and each that was not passed."""
    if not result.validation:
        return ""
    counts = Counter(each.outcome for each in result.validation)
    told = ", ".join(f"{counts[kind]} {kind}" for kind in ("pass", "fail", "undecided") if counts[kind])
    return "\n".join(
        [f"validation: {told}", *(_not_passed(each) for each in result.validation if each.outcome != "pass")]
    )


def _not_passed(each: Validation) -> str:
    value = "not available" if each.value is None else f"{each.value:.3g}"
    bar = "" if each.std is None else f" ± {each.std:.2g}"
    side = "at least" if each.at_least else "at most"
    text = f"  {each.outcome:<9} {each.name}: {value}{bar} ({side} {each.limit:.3g}; {each.where})"
    return textwrap.fill(text, WIDTH, subsequent_indent=12 * " ")
