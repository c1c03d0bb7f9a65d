"""Refits: what screening likes, fitted completely, in stages that drop the hopeless on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from identification.progress import Work
from identification.recording import Array
from lab.diagnosis.calibrate import Calibration
from lab.diagnosis.candidate import Candidate, last_of
from lab.diagnosis.fit import Fit, fit, objective, resumed, theta_slopes
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.observer import kalman_gain
from lab.diagnosis.screening import Screened, coarsely, enough_samples
from lab.hands import shared

ROUGH = 4
"""Iterations before candidates are compared: from a model badly off, each makes the residual a few times smaller."""
KEPT = 5
"""Candidates kept after each stage of their refits, besides those that are as good within `CLOSE`."""
CLOSE = 30.0
NEGLIGIBLE = 1e-3
"""Unknown force, as a share of the inertia forces, that nobody would miss in a model."""

_Begin = tuple[Array, tuple[Hypothesis, ...]]
"""Parameters and causes from which a fit begins."""


def refitted(
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
    # What leads into the neighbourhood is not yet judged.
    coarse = replace(coarsely(misfit, present.theta, present.causes), n_train=enough_samples(misfit))
    # Causes are small at first: those who start together share the slopes of the model without them.
    share, seen = (shares[0], coarse) if shares else (0.0, misfit)
    near = [_Near.at(seen, theta, present, share) for theta in _starts_of(picked)]
    for share, part in zip(shares, leading_, strict=True):
        led = part.each(
            shared(partial(_led, coarse, share, near), [row[:2] for row in running]), len(running)
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


def polished(misfit: Misfit, without: float, candidate: Candidate) -> Candidate:
    """The candidate fitted to full convergence."""
    found = resumed(misfit, candidate.fit, iterations=15, tolerance=0.1)
    return max(candidate, last_of(found, candidate.guided, without), key=lambda c: c.gain)


def steadied(calibration: Calibration, candidates: list[Candidate], without: float) -> list[Candidate]:
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
    if not misfit.plant(guided.theta, guided.causes).laws:
        return candidates
    # It was led with few substeps and samples, and is held against a fit with as many as fits take.
    left = misfit.residual(guided.theta, guided.causes, observer=guided.observer)
    if first.fit.objective <= objective(left, guided.theta, guided.precision, misfit.counting_as_one()):
        return candidates
    theta, causes, share = guided.theta, guided.causes, calibration.share
    steps = np.geomspace(share / 10, NEGLIGIBLE, max(int(2 * np.log10(share / 10 / NEGLIGIBLE)), 0) + 1)
    for share in steps:
        try:
            observer = kalman_gain(misfit, theta, share)
        except np.linalg.LinAlgError:
            return candidates
        led_on = tried(misfit, theta, causes, observer, iterations=8, tolerance=5)
        if led_on is None:
            return candidates
        guided, theta, causes = led_on, led_on.theta, led_on.causes
    steady = last_of(guided, first.guided, without)
    return [steady if c is first and steady.gain > c.gain else c for c in candidates]
