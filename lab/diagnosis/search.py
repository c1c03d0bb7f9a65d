"""Search: every cause at every place, screened cheaply; the best refitted completely and compared by evidence."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.recording import Array
from lab.diagnosis.calibrate import Calibration
from lab.diagnosis.chance import NO_CHANCE, Chance, quantile
from lab.diagnosis.changes import large_changes, stiff_springs
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.fit import POOL, Fit, cause_slopes, fit, moved_by, objective, theta_slopes, weights
from lab.diagnosis.misfit import Hypothesis, Misfit
from lab.diagnosis.observer import kalman_gain
from lab.diagnosis.places import echoes, mends, tone
from lab.diagnosis.plausible import plausible
from lab.effects.effect import EVERYWHERE, Effect

OWN_PARAMETERS = {"mass": "mass_change", "stiffness": "stiffness_change", "damping": "damping_change"}
SCREEN_SAMPLES = 4096
SCREEN_SUBSTEPS = 3
"""Enough to rank causes by, where nothing else in the model has a law."""
STEPPED_ON = 40
"""Hypotheses that get more than one step in the screening."""
REFITTED, PER_CAUSE, POLISHED = 10, 2, 3
KEPT = 5
"""Candidates kept after each stage of their refits, besides those that are as good within `CLOSE`."""
CLOSE = 30.0
SUSPECTS = 4
"""Parameters that may hide one another."""
NEGLIGIBLE = 1e-3
"""Unknown force, as a share of the inertia forces, that nobody would miss in a model."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A cause at a place with the evidence for it.

    Attributes:
        cause: name of the cause.
        location: where it sits.
        fit: with it.
        gain: 2 log evidence gained over the model without it.
        guided: the fit on its way, while measurements still guided the state.
        direction: among the model's parameters, for a change of what the model has already.
        beside: direction of a second such change without which this one does not show; the gain is half of what both bring.
    """

    cause: str
    location: str
    fit: Fit
    gain: float
    direction: Array | None = None
    guided: Fit | None = None
    beside: Array | None = None


_Start = tuple[Hypothesis, Array, Array, Array, float, float]
"""A hypothesis, its residual, what is left of it with the model's parameters projected out, these, objective, damping."""


@dataclass(frozen=True, eq=False)
class Screened:
    """Score of one hypothesis after a few steps with the model's parameters projected out."""

    hypothesis: Hypothesis
    score: float


def hypotheses(misfit: Misfit, effects: Mapping[str, type[Effect]]) -> list[Hypothesis]:
    """Every cause at every place from every starting value."""
    survey = misfit.survey
    assert survey is not None
    return [
        Hypothesis.starting(kind, location, guess)
        for kind in effects.values()
        for location in kind.places(survey.rig)
        for guess in kind.guesses(survey, location)
        # A place that the test does not move has no scale.
        if all(0 < abs(scale) < np.inf for scale in guess.scale.values())
    ]


def screen(
    misfit: Misfit,
    theta: Array,
    present: Sequence[Hypothesis],
    observer: Array,
    proposed: Sequence[Hypothesis],
) -> tuple[list[Screened], Array]:
    """Hypotheses by falling score: the likelihood gained in a few steps, less the price of their variables.

    Beside them, the best score that each of many draws of mere noise would have given.
    """
    n_train = tuple(min(n, SCREEN_SAMPLES) for n in misfit.n_train)
    if not misfit.plant(theta, present).laws:
        misfit = replace(misfit, substeps=SCREEN_SUBSTEPS)
    e = misfit.residual(theta, present, observer=observer, n_train=n_train)
    slopes = np.concatenate(
        [
            theta_slopes(misfit, theta, present, observer, e, n_train),
            cause_slopes(misfit, theta, present, observer, e, n_train),
        ]
    )
    P = misfit.parameters.precision
    colour = misfit.colour
    base = objective(e, theta, P, colour)
    w = weights(e, colour)
    J = (slopes * w[:, None]).reshape(slopes.shape[0], -1)
    n, size = theta.size, len(slopes)
    prior = np.zeros((size, size))
    prior[:n, :n] = P
    H = np.linalg.pinv(J @ J.T + prior, rcond=1e-13, hermitian=True)
    chance = Chance(e.shape, sum(misfit.n_train) * len(e))

    def projected(r: Array) -> tuple[Array, Array, float]:
        """Residual less what the model's parameters can explain of it, the parameters then, and the objective."""
        d = -H @ (J @ (r * w[:, None]).ravel() + prior[:, :n] @ theta)
        left = r + np.tensordot(d, slopes, axes=1)
        return left, theta + d[:n], objective(left, theta + d[:n], P, colour)

    def own_slopes(h: Hypothesis, r: Array) -> tuple[Array, Array]:
        """Slopes of the residual by a hypothesis' own variables, the model's parameters following, and slopes of these."""
        own = cause_slopes(misfit, theta, [*present, h], observer, r, n_train)[-h.n :]
        follow = np.array([-H @ (J @ (x * w[:, None]).ravel()) for x in own])
        return own + np.tensordot(follow, slopes, axes=1), follow[:, :n]

    def stepped(started: _Start, own: Array, follow: Array) -> _Start:
        """A start after a Gauss-Newton step on its own variables; itself where none helps."""
        h, _, left, parameters, f, damping = started
        v = weights(left, colour)
        A = (own * v[:, None]).reshape(h.n, -1)
        # What a cause explains, the parameters need not: the prior is relieved.
        G = A @ A.T + follow @ P @ follow.T
        g = A @ (left * v[:, None]).ravel() + follow @ P @ parameters
        if not (np.all(np.isfinite(G)) and np.trace(G) > 0):
            return started
        for _ in range(4):
            step = -np.linalg.solve(G + (damping * np.diag(np.diag(G)) + 1e-9 * np.trace(G) * np.eye(h.n)), g)
            (trial,) = moved_by([h], step)
            trial_r = misfit.residual(theta, [*present, trial], observer=observer, n_train=n_train)
            trial_left, trial_parameters, trial_f = projected(trial_r)
            if trial_f < f:
                return trial, trial_r, trial_left, trial_parameters, trial_f, damping / 5
            damping = max(damping, 1e-2) * 10
        return started

    def score(started: _Start) -> float:
        h, f = started[0], started[4]
        found = base - f - max(h.n, 1) * float(np.log(e.size))
        return found if np.isfinite(found) else -np.inf

    def looked_at(h: Hypothesis) -> tuple[_Start, Array]:
        """A hypothesis after one step, and what it would have gained from noise."""
        r = misfit.residual(theta, [*present, h], observer=observer, n_train=n_train)
        started: _Start = (h, r, *projected(r), 1e-2)
        if not (h.n and np.isfinite(started[4])):
            return started, NO_CHANCE
        own, follow = own_slopes(h, r)
        lucky = chance.tones if tone(h) is not None else chance.gains(own * w[:, None])
        return stepped(started, own, follow), lucky

    def followed(started: _Start) -> _Start:
        """A start after a few steps more."""
        for _ in range(3 if started[0].n and np.isfinite(started[4]) else 0):
            before = started[4]
            started = stepped(started, *own_slopes(started[0], started[1]))
            if before - started[4] < 1:
                break
        return started

    looks = list(POOL.map(looked_at, proposed))
    lucky = np.max([each for _, each in looks], axis=0, initial=-np.inf)
    first = sorted((started for started, _ in looks), key=lambda started: -score(started))
    again = list(POOL.map(followed, first[:STEPPED_ON]))
    rows = [Screened(started[0], score(started)) for started in again + first[STEPPED_ON:]]
    return sorted(rows, key=lambda row: -row.score), lucky


def search(
    calibration: Calibration, present: Fit, effects: Mapping[str, type[Effect]]
) -> tuple[list[Candidate], float]:
    """Candidates for one more cause beside those present, best first, and the 2 log evidence that chance alone may reach."""
    misfit = calibration.misfit
    causes = present.causes
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
    rows, lucky = screen(misfit, theta, causes, observer, proposed)
    picked: list[Hypothesis] = []
    places: set[tuple[str, str, str]] = set()
    for row in rows:
        h = row.hypothesis
        key = (h.kind.cause, h.location, str(h.guess.fixed))
        same = sum(other.kind is h.kind and other.guess.fixed == h.guess.fixed for other in picked)
        if key not in places and same < PER_CAUSE and len(picked) < REFITTED and row.score > -30:
            picked.append(h)
            places.add(key)
    without = minus_two_log_evidence(present)
    refits = _refitted(calibration, theta, present, picked)
    scored = sorted((_candidate(f, g, without) for f, g in refits), key=lambda c: -c.gain)
    best = [_polished(misfit, c, without) for c in scored[:POLISHED]] + scored[POLISHED:]
    own = sorted(wrong_parameters(misfit, present, without, effects), key=lambda c: -c.gain)
    candidates = [_confirmed(misfit, c, without) for c in own[:POLISHED]]
    # What was not confirmed may not rank before what was.
    weakest = min((c.gain for c in candidates), default=0.0)
    candidates += [replace(c, gain=min(c.gain, weakest)) for c in own[POLISHED:]]
    candidates += _steadied(calibration, best, without)
    candidates += [
        Candidate(cause, place, found, without - minus_two_log_evidence(found), direction)
        for cause, place, direction, found in large_changes(misfit, present, effects)
        if not mends(effects[cause], place, [(each.kind, each.location) for each in causes], survey)
    ]
    candidates += [_candidate(found, None, without) for found in stiff_springs(misfit, present, proposed)]
    band = 1 / survey.duration, 0.5 / survey.dt
    candidates = [c for c in candidates if c.direction is not None or plausible(c.fit.causes[-1], band)]
    ranked: dict[tuple[str, str], Candidate] = {}
    for candidate in sorted(candidates, key=lambda c: -c.gain):
        ranked.setdefault((candidate.cause, candidate.location), candidate)
    return list(ranked.values()), quantile(lucky, misfit.parameters.n_factors)


def _refitted(
    calibration: Calibration, theta: Array, present: Fit, picked: Sequence[Hypothesis]
) -> list[tuple[Fit, Fit | None]]:
    """Complete fits with each new cause, trusting the measurements less and less; the hopeless are dropped on the way.

    Beside each fit stands the last one that trusted the measurements.
    """
    misfit = calibration.misfit
    shares = (
        [] if present.causes else [s for s in (calibration.share, calibration.share / 10) if s > NEGLIGIBLE]
    )
    running: list[tuple[Array, tuple[Hypothesis, ...], Fit | None]] = [
        (theta, (*present.causes, h), None) for h in picked
    ]
    for share in shares:
        led = [
            tried(misfit, theta, causes, kalman_gain(misfit, theta, share), iterations=3, tolerance=20)
            for theta, causes, _ in running
        ]
        running = [(f.theta, f.causes, f) for f in leading([f for f in led if f is not None])]
    first = [
        (tried(misfit, theta, causes, present.observer, iterations=2, tolerance=1), guided)
        for theta, causes, guided in running
    ]
    plain = {id(f): guided for f, guided in first if f is not None}
    kept = leading([f for f, _ in first if f is not None])
    found = [(tried(misfit, f.theta, f.causes, present.observer, iterations=6), plain[id(f)]) for f in kept]
    return [(f, guided) for f, guided in found if f is not None]


def tried(
    misfit: Misfit,
    theta: Array,
    causes: Sequence[Hypothesis],
    observer: Array,
    *,
    iterations: int,
    tolerance: float = 0.5,
) -> Fit | None:
    """A fit, or nothing where it fails."""
    try:
        found = fit(misfit, theta, causes, observer=observer, iterations=iterations, tolerance=tolerance)
    except (np.linalg.LinAlgError, ValueError):
        return None
    finite = np.isfinite(found.objective) and np.all(np.isfinite(found.information))
    return found if finite else None


def leading(fits: Sequence[Fit]) -> list[Fit]:
    """The best fits, the price of their variables paid."""
    price = {id(f): f.objective + sum(max(c.n, 1) for c in f.causes) * np.log(f.residual.size) for f in fits}
    ordered = sorted(fits, key=lambda f: price[id(f)])
    return [f for i, f in enumerate(ordered) if i < KEPT or price[id(f)] < price[id(ordered[0])] + CLOSE]


def _confirmed(misfit: Misfit, candidate: Candidate, without: float) -> Candidate:
    """The candidate, a change of the model's own, fitted with its prior lifted: what a quadratic promises may not come true."""
    assert candidate.direction is not None
    parameters, shared = misfit.parameters.lifted(candidate.direction), 1.0
    if candidate.beside is not None:
        parameters, shared = parameters.lifted(candidate.beside), 0.5
    changed = replace(misfit, parameters=parameters)
    found = candidate.fit
    refit = fit(changed, found.theta, found.causes, observer=found.observer, iterations=20, tolerance=0.1)
    return replace(candidate, fit=refit, gain=shared * (without - minus_two_log_evidence(refit)))


def _polished(misfit: Misfit, candidate: Candidate, without: float) -> Candidate:
    """The candidate fitted to full convergence."""
    found = candidate.fit
    polished = fit(
        misfit,
        found.theta,
        found.causes,
        observer=found.observer,
        iterations=15,
        refresh=1,
        tolerance=0.1,
    )
    return max(candidate, _candidate(polished, candidate.guided, without), key=lambda c: c.gain)


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
    steadied = _candidate(guided, first.guided, without)
    return [steadied if c is first and steadied.gain > c.gain else c for c in candidates]


def _candidate(found: Fit, guided: Fit | None, without: float) -> Candidate:
    last = found.causes[-1]
    gain = without - minus_two_log_evidence(found)
    return Candidate(last.kind.cause, last.location, found, gain, guided=guided)


def wrong_parameters(
    misfit: Misfit, present: Fit, without: float, effects: Mapping[str, type[Effect]]
) -> list[Candidate]:
    """Masses, stiffnesses and dampings of the model that leave their tolerance, one by one and all together."""
    assert misfit.survey is not None
    named = [(each.kind, each.location) for each in present.causes]
    found, eye = [], np.eye(misfit.parameters.n)
    loose = np.linalg.eigh(misfit.parameters.precision)
    loose_directions = loose[1][:, loose[0] < 0.5]
    for group, cause in OWN_PARAMETERS.items():
        members = misfit.parameters.group(group)
        proposals = [(misfit.parameters.names[j].partition(" ")[2], eye[j]) for j in members]
        if len(members) > 1:
            proposals.append((EVERYWHERE, eye[members].sum(axis=0)))
        for place, direction in proposals:
            v = direction / np.linalg.norm(direction)
            mending = cause in effects and mends(effects[cause], place, named, misfit.survey)
            fresh = np.linalg.norm(v - loose_directions @ (loose_directions.T @ v)) > 0.5
            if cause in effects and fresh and not mending and abs(v @ present.theta) > 0.5:
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
