"""Stage: how far a diagnosis of spectra has come, and how it goes on: one more cause, a better fit, or a cause less."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lab.diagnosis.candidate import Candidate
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.spectral.experiment import Experiment
from lab.diagnosis.spectral.fit import SpectralFit, fit
from lab.diagnosis.spectral.tones import FoundTone
from lab.diagnosis.spectral.transfer import Complex

DOUBT = 5.0
"""By how much -2 log likelihood of data kept aside may rise by chance with a true cause."""
UNSETTLED = 10.0
"""-2 log posterior by which a fit must fall to be taken for one that had not converged."""


@dataclass(frozen=True, eq=False)
class Stage:
    """How far a diagnosis of spectra has come.

    Attributes:
        experiment: the data, tones that were named taken out.
        likelihood: of its training part.
        fit: parameters, causes and nuisances so far.
        accepted: causes so far.
        held_out: error on data kept aside, of the calibrated model and after each cause.
    """

    experiment: Experiment
    likelihood: Any
    fit: SpectralFit
    accepted: tuple[Candidate | FoundTone, ...]
    held_out: tuple[float, ...]


def confirmed(before: Stage, after: Stage) -> bool:
    """Whether data that no fit has seen are no less likely with the last cause than without."""
    deviances = []
    for stage in (before, after):
        held_out = stage.experiment.held_out(stage.likelihood)
        deviances.append(held_out.deviance(predicted(held_out, stage.fit)))
    return bool(deviances[1] < deviances[0] + DOUBT)


def with_cause(stage: Stage, chosen: Candidate | FoundTone) -> Stage:
    """The stage with one more cause accepted, everything refitted together."""
    experiment, likelihood, start = stage.experiment, stage.likelihood, stage.fit
    if isinstance(chosen, FoundTone):
        experiment = experiment.without(chosen)
        likelihood = experiment.again(likelihood)
    else:
        assert isinstance(chosen.fit, SpectralFit)
        start = chosen.fit
        if chosen.cause == "stiffness_drift":
            likelihood = experiment.in_parts(likelihood)
        if chosen.direction is not None:
            likelihood = replace(likelihood, parameters=likelihood.parameters.lifted(chosen.direction))
    refit = fit(likelihood, start.theta, start.causes, start.nuisance)
    likelihood = experiment.surveyed(likelihood, refit.nuisance)
    held_out = stage.held_out or (held_out_error(stage),)
    found = Stage(experiment, likelihood, refit, (*stage.accepted, chosen), held_out)
    return replace(found, held_out=(*held_out, held_out_error(found)))


def held_out_error(stage: Stage) -> float:
    """Relative error on data that no fit has seen."""
    held_out = stage.experiment.held_out(stage.likelihood)
    return stage.experiment.error(held_out, predicted(held_out, stage.fit))


def predicted(likelihood: Any, found: SpectralFit) -> Complex:
    """What a fit predicts of the data of a likelihood."""
    return np.asarray(likelihood.predict(found.theta, found.causes, found.nuisance))


def settled(stage: Stage, further: Stage) -> Stage | None:
    """The stage with a better fit, tried from where one with a further cause came to; None where there is none.

    A fit that had not converged makes any further cause look good that gives it another try.
    """
    last = further.accepted[-1]
    if isinstance(last, FoundTone) or last.cause == "stiffness_drift":  # those see other data
        return None
    start = further.fit
    again = fit(stage.likelihood, start.theta, start.causes[: len(stage.fit.causes)], start.nuisance)
    return replace(stage, fit=again) if again.objective < stage.fit.objective - UNSETTLED else None


def without_idle(stage: Stage) -> Stage:
    """The stage without causes whose evidence is gone now that others were found."""
    number = 0
    while number < len(stage.accepted) > 1:
        less = _without(stage, number)
        if less is not None and _cost(less.fit) <= _cost(stage.fit):
            stage, number = less, 0
        else:
            number += 1
    return stage


def _without(stage: Stage, number: int) -> Stage | None:
    """The stage refitted without one of its causes; None for a tone, which was taken out of the data."""
    dropped = stage.accepted[number]
    if isinstance(dropped, FoundTone):
        return None
    kept = (*stage.accepted[:number], *stage.accepted[number + 1 :])
    causes, likelihood = stage.fit.causes, stage.likelihood
    if dropped.direction is None:
        position = sum(_in_the_fit(c) for c in stage.accepted[:number])
        causes = (*causes[:position], *causes[position + 1 :])
    else:
        free = [c.direction for c in kept if isinstance(c, Candidate) and c.direction is not None]
        parameters = replace(likelihood.parameters, precision=np.eye(likelihood.parameters.n))
        likelihood = replace(likelihood, parameters=parameters.lifted(*free))
    found = fit(likelihood, stage.fit.theta, causes, stage.fit.nuisance)
    errors = (*stage.held_out[: number + 1], *stage.held_out[number + 2 :])
    less = replace(stage, likelihood=likelihood, fit=found, accepted=kept, held_out=errors)
    return replace(less, held_out=(*errors[:-1], held_out_error(less)))


def _in_the_fit(cause: Candidate | FoundTone) -> bool:
    """Whether a cause is a hypothesis of the fit, not a change of the model's own nor a tone taken out."""
    return isinstance(cause, Candidate) and cause.direction is None


def _cost(found: SpectralFit) -> float:
    return minus_two_log_evidence(found)  # type: ignore[arg-type]
