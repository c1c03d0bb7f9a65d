"""Search: every cause that spectra can show, at every place, by a linear test; the best refitted, compared by evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.recording import Array
from lab.diagnosis.candidate import Candidate
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.plausible import plausible
from lab.diagnosis.screening import hypotheses
from lab.diagnosis.spectral.changes import changes
from lab.diagnosis.spectral.fit import Point, SpectralFit, fit, point, slopes, system, whitened_error
from lab.diagnosis.spectral.likelihood import Likelihood
from lab.effects.effect import Effect
from lab.hands import beside

REFITTED, PER_CAUSE, POLISHED = 7, 2, 3
NEUTRAL = 1e-9
"""Relative change of the prediction below which a guess counts as no effect at all."""
WORTH = -5.0
"""Score below which a refit is not worth its time: chance scores lower than the price of a variable."""
HOPELESS = -20.0
"""Gain after a rough refit below which no polish helps."""
REACH = 2.0
"""By what factor a fit may move the frequency of an oscillator."""
STRENGTH = {"attached_oscillator": ("mass", 1), "sensor_delay": ("delay", 1), "sensor_lag": ("corner_hz", -1)}
"""For causes whose guesses have an effect: the variable that scales it, and which way."""


@dataclass(frozen=True, eq=False)
class Screened:
    """Score of a hypothesis, started as strong as a linear step says."""

    hypothesis: Hypothesis
    score: float


def screen(likelihood: Likelihood, anchor: SpectralFit, proposed: Sequence[Hypothesis]) -> list[Screened]:
    """Hypotheses by falling score: -2 log posterior that a linear step gains, all else projected out, less its price."""
    at = point(likelihood, anchor.theta, anchor.causes, anchor.nuisance)
    J = slopes(likelihood, at)
    error = whitened_error(likelihood, at)
    gradient, information = system(likelihood, at, J, error)
    H = np.linalg.pinv(information, rcond=1e-13, hermitian=True)
    price = float(np.log(error.size))

    def score(h: Hypothesis) -> Screened:
        rows, deviance = _directions(likelihood, at, h)
        if not rows.size or not np.all(np.isfinite(rows)):
            return Screened(h, -np.inf)
        cross = rows @ J.T
        G = rows @ rows.T - cross @ H @ cross.T
        g = rows @ error - cross @ H @ gradient
        scale = np.sqrt(np.maximum(np.diag(rows @ rows.T), 1e-300))
        values, vectors = np.linalg.eigh(G / np.outer(scale, scale))
        seen = values > 1e-8
        gain = float(np.sum((vectors[:, seen].T @ (g / scale)) ** 2 / values[seen])) if seen.any() else 0.0
        if h.kind.cause in STRENGTH:
            step = float(-g[0] / max(G[0, 0], 1e-300))
            h, gain = _scaled(h, float(np.clip(step, 0.02, 3.0))), gain if step > 0 else 0.0
        if not h.n and deviance - anchor.deviance > gain:
            # Cables are exchanged or not: what makes things far worse as it stands is no small step away.
            return Screened(h, -np.inf)
        return Screened(h, gain - max(h.n, 1) * price)

    return sorted(beside(score, proposed), key=lambda s: -s.score)


def search(
    likelihood: Likelihood,
    present: SpectralFit,
    effects: Mapping[str, type[Effect]],
    *,
    anchors: Sequence[SpectralFit] = (),
    large: bool = True,
) -> tuple[list[Candidate], int]:
    """Candidates for one more cause beside those present, best first, and how many were looked at.

    Args:
        likelihood: model and data.
        present: the fit to be improved.
        effects: causes that may be named.
        anchors: other points with the same causes from which to look, such as the model as given: a calibration that took
            pains to explain a cause it does not have is a bad place to see it from.
        large: whether to try changes of the model's own parameters that are far from where it has them.
    """
    taken = {(cause.kind, cause.location) for cause in present.causes}
    if any(cause.kind.cause == "attached_oscillator" for cause in present.causes):
        # One more degree of freedom is all that a twin can grow.
        effects = {name: kind for name, kind in effects.items() if name != "attached_oscillator"}
    low, high = likelihood.band_hz
    proposed = [
        h
        for h in hypotheses(likelihood, effects)  # type: ignore[arg-type]
        if (h.kind, h.location) not in taken and plausible(h, (low / REACH, high * REACH))
    ]
    picked = [(present, h) for h in _best(screen(likelihood, present, proposed))]
    for anchor in anchors:
        picked += [(anchor, h) for h in _best(screen(likelihood, anchor, proposed))]
    without = _cost(present)
    candidates, looks = changes(likelihood, present, effects, starts=[present, *anchors] if large else [])
    rough = [refitted(likelihood, anchor, h, iterations=6, tolerance=3.0) for anchor, h in picked]
    scored = sorted((candidate(f, without) for f in rough if f is not None), key=lambda c: -c.gain)
    for old in [c for c in scored[:POLISHED] if c.gain > HOPELESS]:
        f = fit(likelihood, old.fit.theta, old.fit.causes, old.fit.nuisance)  # type: ignore[attr-defined]
        candidates.append(max(old, candidate(f, without), key=lambda c: c.gain))
    candidates += [c for k, c in enumerate(scored) if k >= POLISHED or c.gain <= HOPELESS]
    named = [
        c for c in candidates if c.direction is not None or plausible(c.fit.causes[-1], likelihood.band_hz)
    ]
    return _once(sorted(named, key=lambda c: -c.gain)), len(proposed) + looks


def drifting(parts: Likelihood, present: SpectralFit, kind: type[Effect]) -> tuple[list[Candidate], int]:
    """Springs that change over the record, best first, and how many were looked at; from spectra of its parts."""
    base = fit(parts, present.theta, present.causes, present.nuisance, iterations=4, tolerance=0.5)
    taken = {(cause.kind, cause.location) for cause in present.causes}
    proposed = [
        h
        for h in hypotheses(parts, {kind.cause: kind})  # type: ignore[arg-type]
        if (h.kind, h.location) not in taken
    ]
    best = [row.hypothesis for row in screen(parts, base, proposed)[:PER_CAUSE] if row.score > WORTH]
    without = _cost(base)
    fits = [refitted(parts, base, h) for h in best]
    found = [candidate(f, without) for f in fits if f is not None]
    return sorted(found, key=lambda c: -c.gain), len(proposed)


def refitted(
    likelihood: Likelihood,
    present: SpectralFit,
    h: Hypothesis,
    *,
    iterations: int = 20,
    tolerance: float = 0.05,
) -> SpectralFit | None:
    """A complete fit with one more cause; None where it leads nowhere."""
    try:
        found = fit(
            likelihood,
            present.theta,
            (*present.causes, h),
            present.nuisance,
            iterations=iterations,
            tolerance=tolerance,
        )
    except (np.linalg.LinAlgError, ValueError):
        return None
    return found if np.isfinite(found.objective) and np.all(np.isfinite(found.information)) else None


def candidate(found: SpectralFit, without: float) -> Candidate:
    """The last cause of a fit with the evidence it gains."""
    last = found.causes[-1]
    fitted: Any = found
    return Candidate(last.kind.cause, last.location, fitted, without - _cost(found))


def _cost(found: SpectralFit) -> float:
    return minus_two_log_evidence(found)  # type: ignore[arg-type]


def _directions(likelihood: Likelihood, at: Point, h: Hypothesis) -> tuple[Array, float]:
    """Whitened changes of the prediction that a hypothesis offers, and the deviance where it starts.

    They are its slopes where it starts at no effect, else that effect as a whole.
    """
    predicted = likelihood.predict(at.theta, [*at.causes, h], at.nuisance)
    if not np.all(np.isfinite(predicted)):
        return np.zeros((0, 0)), np.inf
    change = predicted - at.predicted
    if np.max(np.abs(change)) > NEUTRAL * np.max(np.abs(at.predicted)):
        deviance = likelihood.deviance(predicted) if not h.n else np.inf
        return likelihood.whitened(at.predicted, change[None]), deviance
    rows = []
    for j in range(h.n):
        step = np.zeros(h.n)
        step[j] = 1e-3
        moved = likelihood.predict(at.theta, [*at.causes, h.at(h.values + step)], at.nuisance)
        rows.append((moved - predicted) / 1e-3)
    return (likelihood.whitened(at.predicted, np.stack(rows)) if rows else np.zeros((0, 0))), np.inf


def _scaled(h: Hypothesis, step: float) -> Hypothesis:
    """A hypothesis of positive variables, so much stronger."""
    name, exponent = STRENGTH[h.kind.cause]
    values = h.values.copy()
    values[list(h.guess.scale).index(name)] += exponent * np.log(step)
    return h.at(values)


def _best(rows: Sequence[Screened]) -> list[Hypothesis]:
    """The hypotheses worth a refit, few of each cause."""
    picked: list[Hypothesis] = []
    for row in rows:
        h = row.hypothesis
        same = [other for other in picked if other.kind is h.kind]
        known = any(other.location == h.location for other in same)
        if not known and len(same) < PER_CAUSE and len(picked) < REFITTED and row.score > WORTH:
            picked.append(h)
    return picked


def _once(candidates: Sequence[Candidate]) -> list[Candidate]:
    """The best of every cause and place, in their order."""
    first: dict[tuple[str, str], Candidate] = {}
    for c in candidates:
        first.setdefault((c.cause, c.location), c)
    return list(first.values())
