"""Search: every cause at every place, screened cheaply; the best refitted completely and compared by evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from identification.progress import UNHEARD, Work
from lab.diagnosis.calibrate import Calibration
from lab.diagnosis.candidate import Candidate, last_of
from lab.diagnosis.chance import quantile
from lab.diagnosis.changes import OWN_CHANGES, large_changes, starts, stiff_springs
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.fit import Fit
from lab.diagnosis.observer import kalman_gain
from lab.diagnosis.places import echoes, mends
from lab.diagnosis.plausible import plausible
from lab.diagnosis.refits import polished, refitted, steadied
from lab.diagnosis.screening import Screened, hypotheses, screen
from lab.diagnosis.tolerance import confirmed, wrong_parameters
from lab.effects.effect import Effect
from lab.hands import shared

REFITTED, PER_CAUSE, POLISHED = 10, 2, 3
COSTS = 26.0, 18.0, 3.0, 1.0, 3.0, 1.0
"""Of screening, refits, polish, the model's own parameters, large changes and stiff springs, as measured."""


def search(
    calibration: Calibration,
    present: Fit,
    effects: Mapping[str, type[Effect]],
    work: Work = UNHEARD,
) -> tuple[list[Candidate], float]:
    """Candidates for one more cause beside those present, best first, and the 2 log evidence that chance alone may reach.

    Changes of what the model has already are among them even where `effects` leaves them out: calibration makes them anyhow,
    and what is out of tolerance is not explained by not being named.
    """
    misfit = calibration.misfit
    causes = present.causes
    screening, refitting, polishing, confirming, changing, stiffening = work.parts(*COSTS)
    if causes:
        theta, observer = present.theta, present.observer
    else:
        theta, observer = calibration.guided.theta, calibration.observer
    survey = misfit.survey
    assert survey is not None
    proposed = hypotheses(misfit, effects)
    found = [(cause.kind, cause.location) for cause in causes]
    proposed = [
        h for h in proposed if not mends(h.kind, h.location, found, survey) and not echoes(h, causes, survey)
    ]
    first, *others = starts(misfit, theta)
    near, far = screening.parts(1.0, 1.0 if others else 0.0)
    # What moves parameters far shows in half the samples, too.
    screened = screen(misfit, first, causes, observer, proposed, near, share=0.5 if others else 1.0)
    for nominal in others:
        observer = kalman_gain(misfit, nominal, calibration.share) if observer.size else observer
        # What shows from here only is large, and among the best of all.
        other = screen(misfit, nominal, causes, observer, proposed, far, share=0.5, places=0)
        screened = screened.beside(other)
    without = minus_two_log_evidence(present)
    own_and_named = {**OWN_CHANGES, **effects}
    refits = refitted(calibration, present, _picked(screened.rows), refitting)
    scored = sorted((last_of(f, g, without) for f, g in refits), key=lambda c: -c.gain)
    leaders = shared(partial(polished, misfit, without), scored[:POLISHED])
    best = [*polishing.each(leaders, POLISHED), *scored[POLISHED:]]
    own = sorted(wrong_parameters(misfit, present, without, own_and_named), key=lambda c: -c.gain)
    candidates = list(confirming.each(shared(partial(confirmed, misfit, without), own[:POLISHED]), POLISHED))
    # What was not confirmed may not rank before what was.
    weakest = min((c.gain for c in candidates), default=0.0)
    candidates += [replace(c, gain=min(c.gain, weakest)) for c in own[POLISHED:]]
    candidates += steadied(calibration, best, without)
    candidates += [
        Candidate(cause, place, found, without - minus_two_log_evidence(found), direction)
        for cause, place, direction, found in large_changes(misfit, present, own_and_named, changing)
        if not mends(own_and_named[cause], place, [(each.kind, each.location) for each in causes], survey)
    ]
    candidates += [
        last_of(found, None, without) for found in stiff_springs(misfit, present, proposed, stiffening)
    ]
    band = 1 / survey.duration, 0.5 / survey.dt
    candidates = [c for c in candidates if c.direction is not None or plausible(c.fit.causes[-1], band)]
    ranked: dict[tuple[str, str], Candidate] = {}
    for candidate in sorted(candidates, key=lambda c: -c.gain):
        ranked.setdefault((candidate.cause, candidate.location), candidate)
    return list(ranked.values()), quantile(screened.lucky, misfit.parameters.n_factors)


def _picked(rows: Sequence[Screened]) -> list[Screened]:
    """The best, at most so many, and of each cause at most so many places from each start."""
    picked: list[Screened] = []
    places: set[tuple[str, str, str, int]] = set()
    for row in rows:
        h = row.hypothesis
        key = (h.kind.cause, h.location, str(h.guess.fixed), id(row.theta))
        others = (each.hypothesis for each in picked if each.theta is row.theta)
        same = sum(other.kind is h.kind and other.guess.fixed == h.guess.fixed for other in others)
        if key not in places and same < PER_CAUSE and len(picked) < REFITTED and row.score > -30:
            picked.append(row)
            places.add(key)
    return picked
