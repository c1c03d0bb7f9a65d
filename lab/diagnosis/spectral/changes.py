"""Changes: masses, stiffnesses and dampings of the model that are wrong, near or far from where the model has them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identification.recording import Array
from lab.diagnosis.candidate import Candidate
from lab.diagnosis.changes import DAMPING_FACTORS, FACTORS, WORTH, directions
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.spectral.fit import SpectralFit, fit, objective
from lab.diagnosis.spectral.likelihood import Likelihood
from lab.diagnosis.spectral.neighbourhood import Trial
from lab.diagnosis.tolerance import wrong_parameters
from lab.effects.effect import Effect

CONFIRMED, FOLLOWED = 3, 4


def changes(
    likelihood: Likelihood,
    present: SpectralFit,
    effects: Mapping[str, type[Effect]],
    starts: Sequence[SpectralFit],
) -> tuple[list[Candidate], int]:
    """Changes of the model's own parameters with the evidence for each, and how many were looked at.

    Small ones stand out in the calibration, which stretches the parameter's prior; each of the best is fitted with that
    prior lifted, since what a quadratic promises may not come true. Large ones are tried at a few factors.

    Args:
        likelihood: model and data.
        present: the fit to be improved.
        effects: causes that may be named.
        starts: points from which large changes are tried, with the same causes.
    """
    without = _cost(present)
    proposed = list(_open(likelihood, effects))
    names = {(cause, location) for cause, location, _ in proposed}
    wrong = wrong_parameters(likelihood, present, without, effects)  # type: ignore[arg-type]
    small = [c for c in wrong if (c.cause, c.location) in names]
    small.sort(key=lambda c: -c.gain)
    confirmed = [_confirmed(likelihood, present, c, without) for c in small[:CONFIRMED]]
    # What was not confirmed may not rank before what was.
    weakest = min((c.gain for c in confirmed), default=0.0)
    rest = [replace(c, gain=min(c.gain, weakest)) for c in small[CONFIRMED:]]
    large = _large(likelihood, effects, starts, without)
    return [*confirmed, *rest, *large], len(proposed)


def _large(
    likelihood: Likelihood,
    effects: Mapping[str, type[Effect]],
    starts: Sequence[SpectralFit],
    without: float,
) -> Iterator[Candidate]:
    """The likeliest large changes from every start, fitted with their priors lifted."""
    parameters = likelihood.parameters
    for start in starts:
        near = likelihood.around(start.theta, start.causes, start.nuisance)
        best: dict[tuple[str, str], tuple[float, Trial, Any]] = {}
        for cause, location, direction in _open(likelihood, effects):
            if parameters.is_free(direction):
                continue
            lifted: Any = replace(likelihood, parameters=parameters.lifted(direction))  # type: ignore[type-var]
            trials = near.along(direction, DAMPING_FACTORS if cause == "damping_change" else FACTORS)
            levels = [(objective(lifted, *trial), trial, (lifted, direction)) for trial in trials]
            best[cause, location] = min(levels, key=lambda level: level[0])
        ranked = sorted(best.items(), key=lambda item: item[1][0])[:FOLLOWED]
        for (cause, location), (reached, trial, (lifted, direction)) in ranked:
            if reached < start.objective - WORTH:
                found: Any = fit(lifted, trial.theta, start.causes, trial.nuisance)
                yield Candidate(cause, location, found, without - _cost(found), direction)


def _open(likelihood: Likelihood, effects: Mapping[str, type[Effect]]) -> Iterator[tuple[str, str, Array]]:
    """Cause, location and direction of every change of a number that is not known: one with a width of zero is."""
    widths = likelihood.parameters.widths
    for cause, location, direction in directions(likelihood, effects):  # type: ignore[arg-type]
        if np.all(widths[direction != 0] > 0):
            yield cause, location, direction


def _confirmed(likelihood: Likelihood, present: SpectralFit, c: Candidate, without: float) -> Candidate:
    """A change fitted with its prior lifted."""
    assert c.direction is not None
    parameters = likelihood.parameters.lifted(*(d for d in (c.direction, c.beside) if d is not None))
    if c.beside is not None:
        without = min(without, minus_two_log_evidence(present, free=c.beside))  # type: ignore[arg-type]
    changed = replace(likelihood, parameters=parameters)  # type: ignore[type-var]
    found: Any = fit(changed, present.theta, present.causes, present.nuisance)
    return replace(c, fit=found, gain=without - _cost(found))


def _cost(found: SpectralFit) -> float:
    return minus_two_log_evidence(found)  # type: ignore[arg-type]
