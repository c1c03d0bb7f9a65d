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
from lab.diagnosis.spectral.fit import SpectralFit, fit, point
from lab.diagnosis.spectral.likelihood import Likelihood
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
    small = wrong_parameters(likelihood, present, without, effects)  # type: ignore[arg-type]
    small.sort(key=lambda c: -c.gain)
    confirmed = [_confirmed(likelihood, present, c, without) for c in small[:CONFIRMED]]
    # What was not confirmed may not rank before what was.
    weakest = min((c.gain for c in confirmed), default=0.0)
    rest = [replace(c, gain=min(c.gain, weakest)) for c in small[CONFIRMED:]]
    proposed = list(directions(likelihood, effects))  # type: ignore[arg-type]
    large = _large(likelihood, present, effects, starts, without)
    return [*confirmed, *rest, *large], len(proposed)


def _large(
    likelihood: Likelihood,
    present: SpectralFit,
    effects: Mapping[str, type[Effect]],
    starts: Sequence[SpectralFit],
    without: float,
) -> Iterator[Candidate]:
    """The likeliest large changes, fitted with their priors lifted."""
    best: dict[tuple[str, str], tuple[float, Array, SpectralFit, Array]] = {}
    parameters = likelihood.parameters
    for cause, location, direction in directions(likelihood, effects):  # type: ignore[arg-type]
        if parameters.is_free(direction):
            continue
        lifted: Any = replace(likelihood, parameters=parameters.lifted(direction))  # type: ignore[type-var]
        for start in starts:
            for factor in DAMPING_FACTORS if cause == "damping_change" else FACTORS:
                theta = start.theta + np.log(factor) * direction / parameters.widths
                reached = point(lifted, theta, start.causes, start.nuisance).objective
                if (cause, location) not in best or reached < best[cause, location][0]:
                    best[cause, location] = (reached, theta, start, direction)
    ranked = sorted(best.items(), key=lambda item: item[1][0])[:FOLLOWED]
    for (cause, location), (reached, theta, start, direction) in ranked:
        if reached < present.objective - WORTH:
            changed = replace(likelihood, parameters=parameters.lifted(direction))  # type: ignore[type-var]
            found: Any = fit(changed, theta, start.causes, start.nuisance)
            yield Candidate(cause, location, found, without - _cost(found), direction)


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
