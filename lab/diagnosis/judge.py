"""Judge: a diagnosis held against the effects that were hidden; the only place where the two meet."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lab.diagnosis.outcome import CONSISTENT, EXPLAINED, Diagnosis, Finding
from lab.effects.effect import Effect
from lab.result import Criterion


def judge_diagnosis(
    diagnosis: Diagnosis,
    hidden: Sequence[Effect],
    *,
    verdict: str | None = None,
    parameter_error: float = 4.0,
) -> tuple[Criterion, ...]:
    """Whether the diagnosis found every hidden effect, nothing else, and their sizes.

    Args:
        diagnosis: what was found.
        hidden: what there was to find.
        verdict: that it must come to; when None, explained with hidden effects and consistent without.
        parameter_error: largest error of a parameter found, in its own standard deviations.
    """
    right = [
        (effect, finding) for effect in hidden for finding in diagnosis.findings if _same(effect, finding)
    ]
    wrong = len(diagnosis.findings) - len(right)
    expected = verdict or (EXPLAINED if hidden else CONSISTENT)
    judged = [
        Criterion("verdict_right", 1.0, float(diagnosis.verdict == expected), diagnosis.verdict == expected),
        Criterion("effects_misnamed", 0.0, float(wrong), wrong == 0),
    ]
    if hidden:
        found = float(len(right))
        judged.insert(1, Criterion("effects_found", float(len(hidden)), found, len(right) == len(hidden)))
        off = max((_deviation(*pair) for pair in right), default=None)
        passed = off is not None and off <= parameter_error
        judged.append(Criterion("parameter_error", parameter_error, off, passed))
    return tuple(judged)


def _same(effect: Effect, finding: Finding) -> bool:
    return (effect.cause, effect.location) == (finding.effect.cause, finding.effect.location)


def _deviation(effect: Effect, finding: Finding) -> float:
    """Largest error of a parameter in its own standard deviations."""
    errors = [0.0]
    for name, true in effect.parameters.items():
        if name in finding.parameters:
            found = finding.parameters[name]
            off = abs(found.value - true)
            errors.append(off / found.std if found.std > 0 else math.inf if off else 0.0)
    return max(errors)
