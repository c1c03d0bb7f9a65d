"""What a scenario requires, held against what was reached."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from lab.result import Criterion

if TYPE_CHECKING:
    from lab.compare import Comparison

AT_LEAST = ("modes", "mac", "effects_found", "verdict_right")
"""Criteria whose value must not fall below the limit; all others must not exceed it."""


def judge(limits: Mapping[str, float | None], comparison: Comparison) -> tuple[Criterion, ...]:
    """One criterion for each limit given.

    Args:
        limits: name -> bound; None where nothing is required.
        comparison: estimate against truth.
    """
    reached = _reached(comparison)
    judged = []
    for name, limit in limits.items():
        if limit is None:
            continue
        value = reached[name]
        good = value is not None and (value >= limit if name in AT_LEAST else value <= limit)
        judged.append(Criterion(name, float(limit), value, good))
    return tuple(judged)


def _reached(comparison: Comparison) -> dict[str, float | None]:
    pairs = comparison.pairs
    return {
        "modes": float(len(pairs)),
        "frequency_error": max((abs(pair.frequency_error) for pair in pairs), default=None),
        "damping_ratio_error": max((abs(pair.damping_error) for pair in pairs), default=None),
        "mac": min((pair.mac for pair in pairs), default=None),
        "mass_error": comparison.mass_error,
        "damping_error": comparison.damping_error,
        "stiffness_error": comparison.stiffness_error,
    }
