"""Revise: what was fitted or named while a cause was missing, once it is found."""

from __future__ import annotations

from collections.abc import Mapping

from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.fit import Fit, resumed
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.places import mends
from lab.diagnosis.refits import leading, tried
from lab.diagnosis.screening import hypotheses
from lab.effects.effect import Effect


def settled(misfit: Misfit, present: Fit, further: Fit) -> Fit:
    """The fit with the causes present, also tried from where one with a further cause came to.

    A fit that had not converged makes any further cause look good that gives it another try.
    """
    causes = further.causes[: len(present.causes)]
    again = tried(misfit, further.theta, causes, present.observer, iterations=10)
    return present if again is None else min(present, again, key=lambda f: f.objective)


def restarted(misfit: Misfit, found: Fit) -> Fit:
    """The fit, also tried from where only what has no prior is not as the model says.

    While a cause is missing, the model's parameters are led astray by it, and behind kinks they may not find back.
    """
    nominal = misfit.parameters.nominal(found.theta)
    again = tried(misfit, nominal, found.causes, found.observer, iterations=15)
    return found if again is None else min(found, again, key=lambda f: f.objective)


def renamed(misfit: Misfit, found: Fit, number: int, effects: Mapping[str, type[Effect]]) -> Fit:
    """The fit with one of its causes exchanged for another at its place, if that has more evidence; else the fit itself."""
    assert misfit.survey is not None
    cause = found.causes[number]
    rivals = [
        h
        for h in hypotheses(misfit, effects)
        if mends(h.kind, h.location, [(cause.kind, cause.location)], misfit.survey)
        and (h.kind is not cause.kind or h.guess.fixed != cause.guess.fixed)
    ]
    before, behind = found.causes[:number], found.causes[number + 1 :]
    trials = [
        tried(misfit, found.theta, (*before, h, *behind), found.observer, iterations=4, tolerance=1)
        for h in rivals
    ]
    best, evidence = found, minus_two_log_evidence(found)
    for trial in leading([f for f in trials if f is not None]):
        polished = resumed(misfit, trial, iterations=15)
        own = minus_two_log_evidence(polished)
        if own < evidence:
            best, evidence = polished, own
    return best
