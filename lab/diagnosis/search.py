"""Search: every cause at every place, screened cheaply; the best refitted completely and compared by evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.diagnosis.calibrate import Calibration
from lab.diagnosis.candidate import Candidate, last_of
from lab.diagnosis.chance import quantile
from lab.diagnosis.changes import OWN_CHANGES, large_changes, starts, stiff_springs
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.fit import Fit, fit, theta_slopes
from lab.diagnosis.misfit import Hypothesis, Misfit
from lab.diagnosis.observer import kalman_gain
from lab.diagnosis.places import echoes, mends
from lab.diagnosis.plausible import plausible
from lab.diagnosis.screening import Screened, hypotheses, screen
from lab.diagnosis.tolerance import confirmed, wrong_parameters
from lab.effects.effect import Effect
from lab.hands import shared

REFITTED, PER_CAUSE, POLISHED = 10, 2, 3
ROUGH = 4
"""Iterations before candidates are compared: from a model badly off, each makes the residual a few times smaller."""
KEPT = 5
"""Candidates kept after each stage of their refits, besides those that are as good within `CLOSE`."""
CLOSE = 30.0
COSTS = 26.0, 18.0, 3.0, 1.0, 3.0, 1.0
"""Of screening, refits, polish, the model's own parameters, large changes and stiff springs, as measured."""
NEGLIGIBLE = 1e-3
"""Unknown force, as a share of the inertia forces, that nobody would miss in a model."""


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
        screened = screened.beside(screen(misfit, nominal, causes, observer, proposed, far, share=0.5))
    without = minus_two_log_evidence(present)
    own_and_named = {**OWN_CHANGES, **effects}
    refits = _refitted(calibration, present, _picked(screened.rows), refitting)
    scored = sorted((last_of(f, g, without) for f, g in refits), key=lambda c: -c.gain)
    leaders = shared(partial(_polished, misfit, without), scored[:POLISHED])
    best = [*polishing.each(leaders, POLISHED), *scored[POLISHED:]]
    own = sorted(wrong_parameters(misfit, present, without, own_and_named), key=lambda c: -c.gain)
    candidates = list(confirming.each(shared(partial(confirmed, misfit, without), own[:POLISHED]), POLISHED))
    # What was not confirmed may not rank before what was.
    weakest = min((c.gain for c in candidates), default=0.0)
    candidates += [replace(c, gain=min(c.gain, weakest)) for c in own[POLISHED:]]
    candidates += _steadied(calibration, best, without)
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


def _refitted(
    calibration: Calibration, present: Fit, picked: Sequence[Screened], work: Work
) -> list[tuple[Fit, Fit | None]]:
    """Complete fits with each new cause, trusting the measurements less and less; the hopeless are dropped on the way.

    Beside each fit stands the last one that trusted the measurements.
    """
    misfit = calibration.misfit
    shares = (
        [] if present.causes else [s for s in (calibration.share, calibration.share / 10) if s > NEGLIGIBLE]
    )
    running: list[tuple[Array, tuple[Hypothesis, ...], Fit | None]] = [
        (row.theta, (*present.causes, row.hypothesis), None) for row in picked
    ]
    *leading_, rough, whole = work.parts(*[3.0 for _ in shares], 2.0, 3.0)
    # Causes are small at first: those who start together share the slopes of the model without them.
    near = [_Near.at(misfit, theta, present, shares[0] if shares else 0.0) for theta in _starts_of(picked)]
    for share, part in zip(shares, leading_, strict=True):
        led = part.each(
            shared(partial(_led, misfit, share, near), [row[:2] for row in running]), len(running)
        )
        running = [(f.theta, f.causes, f) for f in leading([f for f in led if f is not None])]
        near = []
    roughly = shared(partial(_roughly, misfit, present.observer, near), [row[:2] for row in running])
    fits = list(rough.each(roughly, len(running)))
    plain = {id(f): guided for f, (_, _, guided) in zip(fits, running, strict=True)}
    kept = leading([f for f in fits if f is not None])
    wholly = shared(partial(_wholly, misfit, present.observer), [(f.theta, f.causes) for f in kept])
    found = [(f, plain[id(start)]) for f, start in zip(whole.each(wholly, len(kept)), kept, strict=True)]
    return [(f, guided) for f, guided in found if f is not None]


_Begin = tuple[Array, tuple[Hypothesis, ...]]
"""Parameters and causes from which a fit begins."""


@dataclass(frozen=True, eq=False)
class _Near:
    """Slopes of the parameters near a start, without the causes that start there.

    Attributes:
        theta: parameters at the start.
        observer: gain that pulled the state to the measurements.
        slopes: of the residual, (n_parameters, n_outputs, n).
    """

    theta: Array
    observer: Array
    slopes: Array

    @classmethod
    def at(cls, misfit: Misfit, theta: Array, present: Fit, share: float) -> _Near:
        """Slopes with an unknown force of that share, or with the observer of the fit so far."""
        observer = kalman_gain(misfit, theta, share) if share else present.observer
        e = misfit.residual(theta, present.causes, observer=observer)
        return cls(theta, observer, theta_slopes(misfit, theta, present.causes, observer, e, None))


def _nearest(near: Sequence[_Near], theta: Array) -> _Near | None:
    return next((each for each in near if np.array_equal(each.theta, theta)), None)


def _starts_of(picked: Sequence[Screened]) -> list[Array]:
    """The different parameters that fits begin from."""
    return list({row.theta.tobytes(): row.theta for row in picked}.values())


def _led(misfit: Misfit, share: float, near: Sequence[_Near], begin: _Begin) -> Fit | None:
    """A fit that an unknown force of that share keeps near the measurements."""
    known = _nearest(near, begin[0])
    observer = kalman_gain(misfit, begin[0], share) if known is None else known.observer
    slopes = None if known is None else known.slopes
    return tried(misfit, *begin, observer, iterations=3, tolerance=20, slopes=slopes)


def _roughly(misfit: Misfit, observer: Array, near: Sequence[_Near], begin: _Begin) -> Fit | None:
    """A fit good enough to compare."""
    known = _nearest(near, begin[0])
    slopes = None if known is None else known.slopes
    return tried(misfit, *begin, observer, iterations=ROUGH, refresh=3, tolerance=1, slopes=slopes)


def _wholly(misfit: Misfit, observer: Array, begin: _Begin) -> Fit | None:
    return tried(misfit, *begin, observer, iterations=6)


def tried(
    misfit: Misfit,
    theta: Array,
    causes: Sequence[Hypothesis],
    observer: Array,
    *,
    iterations: int,
    refresh: int = 2,
    tolerance: float = 0.5,
    slopes: Array | None = None,
) -> Fit | None:
    """A fit, or nothing where it fails."""
    try:
        found = fit(
            misfit,
            theta,
            causes,
            observer=observer,
            iterations=iterations,
            refresh=refresh,
            tolerance=tolerance,
            slopes=slopes,
        )
    except (np.linalg.LinAlgError, ValueError):
        return None
    finite = np.isfinite(found.objective) and np.all(np.isfinite(found.information))
    return found if finite else None


def leading(fits: Sequence[Fit]) -> list[Fit]:
    """The best fits, the price of their variables paid."""
    price = {id(f): f.objective + sum(max(c.n, 1) for c in f.causes) * np.log(f.residual.size) for f in fits}
    ordered = sorted(fits, key=lambda f: price[id(f)])
    return [f for i, f in enumerate(ordered) if i < KEPT or price[id(f)] < price[id(ordered[0])] + CLOSE]


def _polished(misfit: Misfit, without: float, candidate: Candidate) -> Candidate:
    """The candidate fitted to full convergence."""
    found = candidate.fit
    polished = fit(
        misfit,
        found.theta,
        found.causes,
        observer=found.observer,
        iterations=15,
        tolerance=0.1,
    )
    return max(candidate, last_of(polished, candidate.guided, without), key=lambda c: c.gain)


def _steadied(calibration: Calibration, candidates: list[Candidate], without: float) -> list[Candidate]:
    """The candidates, the one that follows the measurements best given another try if its simulation lost them.

    Behind gaps and freeplay neighbouring motions part so fast that a simulation over the whole record fits nothing. An
    unknown force too small to matter keeps it near the measurements, and the fit is led there step by step.
    """
    led = [c for c in candidates if c.guided is not None]
    if not led:
        return candidates
    first = min(led, key=lambda c: c.guided.objective if c.guided else np.inf)
    misfit, guided = calibration.misfit, first.guided
    assert guided is not None
    if first.fit.objective <= guided.objective or not misfit.plant(guided.theta, guided.causes).laws:
        return candidates
    theta, causes, share = guided.theta, guided.causes, calibration.share
    steps = np.geomspace(share / 10, NEGLIGIBLE, max(int(2 * np.log10(share / 10 / NEGLIGIBLE)), 0) + 1)
    for share in steps:
        observer = kalman_gain(misfit, theta, share)
        guided = fit(misfit, theta, causes, observer=observer, iterations=8, tolerance=5)
        theta, causes = guided.theta, guided.causes
    steadied = last_of(guided, first.guided, without)
    return [steadied if c is first and steadied.gain > c.gain else c for c in candidates]
