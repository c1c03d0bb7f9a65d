"""The points of a study as rows of text, for the screen and the report."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Sequence
from typing import Any

from lab.studies.outcome import Outcome
from lab.studies.statistics import Statistic

WORDS = {
    "named_rightly": "named rightly",
    "verdict_right": "verdict right",
    "criteria_met": "criteria met",
    "modes_found": "modes found",
    "frequency_covered": "coverage, frequency",
    "damping_covered": "coverage, damping",
    "parameter_covered": "coverage, parameters",
    "mass_covered": "coverage, M",
    "damping_matrix_covered": "coverage, C",
    "stiffness_covered": "coverage, K",
    "frequency_error": "RMS error, frequency",
    "damping_error": "RMS error, damping",
    "mass_error": "RMS error, M",
    "damping_matrix_error": "RMS error, C",
    "stiffness_error": "RMS error, K",
    "parameter_error": "RMS error, parameters",
    "seconds": "seconds",
}
"""Statistics in words; what is collected keeps its own name."""
SHORT = {
    "named_rightly": "named",
    "verdict_right": "verdict",
    "criteria_met": "criteria",
    "modes_found": "found",
    "frequency_covered": "freq.",
    "damping_covered": "±damp.",
    "parameter_covered": "±param.",
    "mass_covered": "±M",
    "damping_matrix_covered": "±C",
    "stiffness_covered": "±K",
    "frequency_error": "freq.",
    "damping_error": "damp.",
    "mass_error": "M",
    "damping_matrix_error": "C",
    "stiffness_error": "K",
    "parameter_error": "param.",
}
"""Heads of the tables on the screen, whose titles say of what."""
SHARES = ("share", "coverage")
WIDTH = 100
SHOWN = 16
"""Points on one screen."""
MAX_SHORT = 16
"""Characters of a value on the screen."""


def words(statistic: Statistic) -> str:
    """A statistic in words."""
    return WORDS.get(statistic.name, statistic.name.removeprefix("collected/"))


def told(value: Any) -> str:
    """A value of a setting in few characters."""
    if isinstance(value, str):
        return value
    if isinstance(value, list) and value and all(isinstance(each, str) for each in value):
        return ", ".join(value)
    return f"{value:.6g}" if isinstance(value, float) else json.dumps(value, ensure_ascii=False, default=str)


def varied(outcome: Outcome) -> list[str]:
    """Paths of the keys that vary; one that has the same value in every run does not."""
    return [path for axis in outcome.study.axes if len(axis) > 1 for path in axis.paths]


def settings(outcome: Outcome, point: int) -> list[Any]:
    """The values at a point of the keys that vary."""
    setting = outcome.study.setting(point)
    return [setting[path] for path in varied(outcome)]


def number(statistic: Statistic, point: int) -> str:
    """A statistic at a point with its interval; empty where no run has it."""
    value, low, high = statistic.value[point], statistic.low[point], statistic.high[point]
    if not math.isfinite(value):
        return ""
    if statistic.kind in ("share", "coverage"):
        return f"{value:.3f} ({low:.2f} to {high:.2f})"
    if not (math.isfinite(low) and math.isfinite(high)):
        return f"{value:.3g}"
    return f"{value:.3g} ({low:.2g} to {high:.2g})"


def study_summary(outcome: Outcome) -> str:
    """One screen that tells what a study came to."""
    study = outcome.study
    failed = f", {outcome.n_failed} of them failed" if outcome.n_failed else ""
    parts = [
        f"{study.title}\n{study.n_runs} runs{failed}: {study.n_points} points, {study.repeats} "
        f"repeat{'s' if study.repeats > 1 else ''}",
        _table(
            "share of runs or modes that succeed, and of error bars (±2 standard deviations) that hold the truth",
            SHARES,
            outcome,
        ),
        _table("RMS errors relative to the truth, and means", ("rms", "mean"), outcome),
        f"and {study.n_points - SHOWN} more points, in report.html and study.h5"
        if study.n_points > SHOWN
        else "",
        "\n".join(textwrap.fill(f"warning: {each}", WIDTH) for each in outcome.warnings),
    ]
    return "\n\n".join(part for part in parts if part)


def _table(title: str, kinds: tuple[str, ...], outcome: Outcome) -> str:
    chosen = [each for each in outcome.statistics if each.kind in kinds]
    if not chosen:
        return ""
    heads = [path.rpartition(".")[2] for path in varied(outcome)] + [
        SHORT.get(each.name, words(each)) for each in chosen
    ]
    rows = [heads]
    points = range(min(outcome.study.n_points, SHOWN))
    columns = zip(*(settings(outcome, point) for point in points), strict=True)
    short = list(zip(*map(_shortened, columns), strict=True)) or [()] * len(points)
    for point in points:
        rows.append([*short[point], *(_value(each, point) for each in chosen)])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([title, *lines])


def _shortened(column: Sequence[Any]) -> list[str]:
    """Values of a setting in few characters; numbered where that leaves different ones alike."""
    there = list(dict.fromkeys(map(told, column)))
    short = [_short(value) for value in column]
    if len(set(short)) == len(there):
        return short
    return [_cut(f"{there.index(told(value)) + 1}) {told(value)}") for value in column]


def _short(value: Any) -> str:
    """A value of a setting, cut where it is long; of a list, how many it has comes first."""
    text = f"{value:.4g}" if isinstance(value, float) else told(value)
    if isinstance(value, list) and len(text) > MAX_SHORT:
        text = f"{len(value)}: {text}"
    return _cut(text)


def _cut(text: str) -> str:
    return text if len(text) <= MAX_SHORT else f"{text[: MAX_SHORT - 1]}…"


def _value(statistic: Statistic, point: int) -> str:
    value = statistic.value[point]
    if not math.isfinite(value):
        return "-"
    if statistic.kind in SHARES:
        return f"{value:.2f}"
    return f"{value:.5g}" if statistic.name.startswith("collected/") else f"{value:.2g}"
