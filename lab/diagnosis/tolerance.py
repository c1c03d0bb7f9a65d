"""Tolerance: masses, stiffnesses and dampings of the model that are farther off than its tolerances allow."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lab.diagnosis.candidate import Candidate
from lab.diagnosis.changes import directions
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.fit import Fit, resumed
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.places import mends
from lab.effects.effect import EVERYWHERE, Effect

SUSPECTS = 4
"""Parameters that may hide one another."""


def wrong_parameters(
    misfit: Misfit, present: Fit, without: float, effects: Mapping[str, type[Effect]]
) -> list[Candidate]:
    """Masses, stiffnesses and dampings of the model that leave their tolerance, one by one and all together."""
    assert misfit.survey is not None
    named = [(each.kind, each.location) for each in present.causes]
    found = []
    for cause, place, direction in directions(misfit, effects):
        v = direction / np.linalg.norm(direction)
        mending = mends(effects[cause], place, named, misfit.survey)
        if not misfit.parameters.is_free(direction) and not mending and abs(v @ present.theta) > 0.5:
            gain = without - minus_two_log_evidence(present, free=direction)
            found.append(Candidate(cause, place, present, gain, direction))
    return _unmasked(found, without)


def _unmasked(candidates: Sequence[Candidate], without: float) -> list[Candidate]:
    """The candidates, the farthest ones with what they gain beside each other where that is more than each gains alone.

    Two parameters far off widen the spread that all are held against, and so hide one another.
    """
    best = list(candidates)
    single = [i for i, c in enumerate(best) if c.location != EVERYWHERE]
    far = sorted(single, key=lambda i: -abs(_off(best[i])))[:SUSPECTS]
    for i, j in itertools.permutations(far, 2):
        one, other = candidates[i], candidates[j]
        both = without - minus_two_log_evidence(one.fit, free=np.array([one.direction, other.direction]))
        # Two looks share what they gain together.
        if 0.5 * both > max(best[i].gain, other.gain):
            best[i] = replace(one, gain=0.5 * both, beside=other.direction)
    return best


def _off(candidate: Candidate) -> float:
    """How far a parameter is from its nominal value, in widths."""
    assert candidate.direction is not None
    return float(candidate.fit.theta @ candidate.direction)


def confirmed(misfit: Misfit, without: float, candidate: Candidate) -> Candidate:
    """The candidate, a change of the model's own, fitted with its prior lifted: what a quadratic promises may not come true."""
    assert candidate.direction is not None
    parameters, shared = misfit.parameters.lifted(candidate.direction), 1.0
    if candidate.beside is not None:
        parameters, shared = parameters.lifted(candidate.beside), 0.5
    changed = replace(misfit, parameters=parameters)
    refit = resumed(changed, candidate.fit, iterations=20, tolerance=0.1)
    return replace(candidate, fit=refit, gain=shared * (without - minus_two_log_evidence(refit)))
