"""Tables of many judged answers."""

from __future__ import annotations

import collections
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.blind_cases.power import LEVEL, best_power
from lab.diagnosis.outcome import CONSISTENT, EXPLAINED

Row = Mapping[str, Any]
EDGES = (0, 1, 2, 3, 4, 6, 8, 12, 16, 32, 64, 256, 1e4, np.inf)
"""Of the bins of the deflection."""


def tables(rows: Sequence[Row]) -> str:
    """Everything, as text."""
    done = [row for row in rows if "error" not in row]
    parts = [families(rows), confusion(done), failures(rows)]
    if any(np.isfinite(row["deflection"]) for row in done):
        parts.insert(1, power(done))
    return "\n\n".join(part for part in parts if part)


def families(rows: Sequence[Row]) -> str:
    """One line per family."""
    head = (
        f"{'family':16}{'cases':>6}{'failed':>7}{'cause':>8}{'place':>8}{'false':>7}{'≤2 std':>8}{'error':>9}{'gain':>7}"
        f"{'consistent':>11}{'explained':>10}{'unexplained':>12}{'median s':>9}{'most s':>8}"
    )
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row["family"] + (" withheld" if row["withheld"] else ""), []).append(row)
    return "\n".join([head, *(_family(name, group) for name, group in groups.items())])


def _family(name: str, group: Sequence[Row]) -> str:
    done = [row for row in group if "error" not in row]
    if not done:
        return f"{name:16}{len(group):6d}{len(group):7d}"
    scores = np.array([score for row in done for score in row["scores"]]).reshape(-1, 2)
    clean = [row for row in done if not row["hidden"]]
    alarms = f"{np.mean([bool(row['told']) for row in clean]):7.1%}" if clean else f"{'':7}"
    numbers = (
        f"{np.mean(scores[:, 1] <= 2):8.1%}{np.median(scores[:, 0]):9.2%}" if len(scores) else f"{'':17}"
    )
    gains = [row["holdout_gain"] for row in done if row["place_right"] and row["told"]]
    gain = f"{np.median(gains):7.2f}" if gains else f"{'':7}"
    verdicts = collections.Counter(row["verdict"] for row in done)
    seconds = [row["seconds"] for row in done]
    right = [sum(row[key] for row in done) / len(group) for key in ("cause_right", "place_right")]
    return (
        f"{name:16}{len(group):6d}{len(group) - len(done):7d}{right[0]:8.1%}{right[1]:8.1%}{alarms}{numbers}{gain}"
        f"{verdicts[CONSISTENT]:11d}{verdicts[EXPLAINED]:10d}{verdicts['unexplained']:12d}"
        f"{np.median(seconds):9.1f}{max(seconds):8.1f}"
    )


def power(rows: Sequence[Row]) -> str:
    """Share detected and named against the deflection, beside the best possible test."""
    lines = [
        f"Power against the deflection of the best test, which errs in {LEVEL:.0%} of clean cases",
        f"{'deflection':>16}{'cases':>7}{'best':>8}{'detected':>10}{'named':>8}",
    ]
    known = [row for row in rows if np.isfinite(row["deflection"]) and not row["withheld"]]
    for low, high in itertools.pairwise(EDGES):
        inside = [row for row in known if low <= row["deflection"] < high]
        if inside:
            best = np.mean([best_power(row["deflection"]) for row in inside])
            detected = np.mean([row["verdict"] != CONSISTENT for row in inside])
            named = np.mean([row["place_right"] for row in inside])
            lines.append(f"{low:7g} to {high:5g}{len(inside):7d}{best:8.1%}{detected:10.1%}{named:8.1%}")
    return "\n".join(lines)


def confusion(rows: Sequence[Row]) -> str:
    """What was said of every cause: how often the cause itself, and each other one."""
    said: dict[str, collections.Counter[str]] = {}
    for row in rows:
        names = [cause for cause, _ in row["told"]]
        hidden = [cause for cause, _, _ in row["hidden"]] or ["nothing"]
        for cause in hidden:
            word = cause if cause in names else next((n for n in names if n not in hidden), row["verdict"])
            said.setdefault(cause, collections.Counter())[word] += 1
    lines = ["Hidden, and what was said of it"]
    for cause, counts in sorted(said.items()):
        listed = ", ".join(f"{word} {count}" for word, count in counts.most_common())
        lines.append(f"{cause:22}{listed}")
    return "\n".join(lines)


def failures(rows: Sequence[Row]) -> str:
    """Every answer that is not right."""
    wrong = [row for row in rows if "error" in row or not row["place_right"]]
    return "\n".join(["Not right", *(failure(row) for row in wrong)]) if wrong else ""


def failure(row: Row) -> str:
    """One line about a wrong answer: how to draw it, the truth, what was said, and by what margin."""
    case = f"{row['family']} seed {row['seed']}" + (f" only {row['only']}" if row["only"] else "")
    case += (" withheld" if row["withheld"] else "") + (
        f" × {row['strength']:g}" if row["strength"] != 1 else ""
    )
    case += "".join(f" {name} {row[name]}" for name in ("masses", "samples") if row.get(name))
    if "error" in row:
        return f"  {case}: {row['error']}"
    hidden = (
        " + ".join(f"{cause}@{place} {_short(values)}" for cause, place, values in row["hidden"]) or "nothing"
    )
    told = (
        " + ".join(f"{c}@{p} ({g:.0f})" for (c, p), g in zip(row["told"], row["gains"], strict=True))
        or "nothing"
    )
    others = ", ".join(f"{c}@{p} ({g:.0f})" for c, p, g in row["alternatives"][:3])
    floor, nominal, calibrated, extended = row["errors"]
    return (
        f"  {case}, deflection {row['deflection']:.3g}: {hidden}; said {row['verdict']} {told}; next {others or 'none'}; "
        f"errors nominal {nominal:.4f}, calibrated {calibrated:.4f}, extended {extended:.4f}, floor {floor:.4f}; "
        f"{' '.join(row['warnings'])}"
    )


def _short(values: Mapping[str, float]) -> str:
    return "(" + ", ".join(f"{name} {value:.4g}" for name, value in values.items()) + ")" if values else ""
