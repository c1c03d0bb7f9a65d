"""Changes: masses, stiffnesses and dampings so far from the model's that no step from there would find them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.diagnosis.fit import Fit, finite, fit, objective, theta_slopes, weights
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.starts import best_starts
from lab.effects import EFFECTS
from lab.effects.effect import EVERYWHERE, Effect
from lab.effects.missing_spring import MissingSpring
from lab.hands import shared

OWN_PARAMETERS = {"mass": "mass_change", "stiffness": "stiffness_change", "damping": "damping_change"}
OWN_CHANGES = {cause: EFFECTS[cause] for cause in OWN_PARAMETERS.values()}
FACTORS = np.geomspace(1 / 4, 4, 28)
"""So close that a lightly damped resonance is not stepped over in a window of ten swings."""
DAMPING_FACTORS = np.geomspace(1 / 16, 16, 16)
SPRING_FACTORS = np.geomspace(0.03, 3, 14)
"""Stiffness of a missing spring over what its place has already."""
WINDOW = 1024
"""Samples of every record on which factors are tried; so many times more where several count as one."""
WORTH = 20.0
"""-2 log posterior that a trial value must gain to be followed."""
FOLLOWED = 4
RESTARTS = 4
"""Steps by which the start of a record is adapted to laws of force, which its first estimate leaves out."""
FAR = 4.0
"""Widths beyond which a parameter may have gone to make up for a cause, which then shows better from the model as given."""

_Trial = tuple[float, str, str, Array, Array]
"""-2 log posterior of a large change, its cause, location and direction, and the parameters with it."""


def starts(misfit: Misfit, theta: Array) -> list[Array]:
    """The parameters, and beside them the nominal ones where they have gone far to make up for a cause."""
    nominal = misfit.parameters.nominal(theta)
    return [theta, nominal] if np.max(np.abs(theta - nominal)) > FAR else [theta]


def directions(misfit: Misfit, effects: Mapping[str, type[Effect]]) -> Iterator[tuple[str, str, Array]]:
    """Cause, location and direction among the parameters of every change of what the model has already."""
    eye = np.eye(misfit.parameters.n)
    for group, cause in OWN_PARAMETERS.items():
        members = misfit.parameters.group(group)
        if cause in effects:
            for j in members:
                yield cause, misfit.parameters.names[j].partition(" ")[2], eye[j]
            if len(members) > 1:
                yield cause, EVERYWHERE, eye[members].sum(axis=0)


def large_changes(
    misfit: Misfit, present: Fit, effects: Mapping[str, type[Effect]], work: Work = UNHEARD
) -> list[tuple[str, str, Array, Fit]]:
    """Cause, location, direction and fit of the likeliest large changes; none where the data do not ask for any.

    Each is tried at a few factors and followed from the best, its prior lifted: a doubled mass moves a resonance so far that
    slopes at the model's own value point nowhere.
    """
    seen = _windowed(misfit)
    reference = _level(seen, present, present.theta, present.causes)
    trying, following = work.parts(2.0, 1.0)
    begun = list(itertools.product(directions(misfit, effects), starts(misfit, present.theta)))
    tried = trying.each(shared(partial(_best_factor, seen, present), begun), len(begun))
    best: dict[tuple[str, str], _Trial] = {}
    for trial in sorted(tried, key=lambda trial: trial[0]):
        best.setdefault(trial[1:3], trial)
    followed = [trial for trial in list(best.values())[:FOLLOWED] if trial[0] < reference - WORTH]
    refits = following.each(shared(partial(_followed, misfit, present), followed), len(followed))
    return [
        (cause, location, direction, refit)
        for (_, cause, location, direction, _), refit in zip(followed, refits, strict=True)
    ]


def _best_factor(seen: Misfit, present: Fit, begun: tuple[tuple[str, str, Array], Array]) -> _Trial:
    """The likeliest of the factors on what a direction changes."""
    (cause, location, direction), start = begun
    lifted = replace(seen, parameters=seen.parameters.lifted(direction))
    trials = []
    for factor in DAMPING_FACTORS if cause == "damping_change" else FACTORS:
        theta = _restarted(seen, start + np.log(factor) * direction / seen.parameters.widths)
        trials.append((_level(lifted, present, theta, present.causes), theta))
    level, theta = min(trials, key=lambda trial: trial[0])
    if seen.parameters.started and seen.plant(theta, present.causes).laws:
        level, theta = _started_again(lifted, present, level, theta)
    return level, cause, location, direction, theta


def _followed(misfit: Misfit, present: Fit, trial: _Trial) -> Fit:
    """The fit that a trial leads to, its prior lifted."""
    _, _, _, direction, theta = trial
    changed = replace(misfit, parameters=misfit.parameters.lifted(direction))
    return fit(changed, theta, present.causes, observer=present.observer, iterations=15)


def stiff_springs(
    misfit: Misfit, present: Fit, proposed: Sequence[Hypothesis], work: Work = UNHEARD
) -> list[Fit]:
    """Fits with the likeliest missing springs so stiff that no step from none at all would find them.

    Each is tried at a few stiffnesses, as a large change is, and followed from the best: beside the parameters as they are, and
    beside nominal ones, since without the spring these may have gone far to make up for it.
    """
    seen, followed = _windowed(misfit), []
    for theta in work.each((present.theta, misfit.parameters.nominal(present.theta))):
        reference = _level(seen, present, theta, present.causes) - WORTH
        springs = [h for h in proposed if h.kind is MissingSpring]
        best = list(shared(partial(_best_stiffness, seen, present, theta), springs))
        best.sort(key=lambda trial: trial[0])
        followed += [(theta, h) for reached, h in best[: FOLLOWED // 2] if reached < reference]
    return list(shared(partial(_sprung, misfit, present), followed))


def _best_stiffness(seen: Misfit, present: Fit, theta: Array, spring: Hypothesis) -> tuple[float, Hypothesis]:
    """The likeliest of the stiffnesses of a missing spring."""
    springs = [spring.at(np.array([factor])) for factor in SPRING_FACTORS]
    levels = [(_level(seen, present, theta, (*present.causes, each)), each) for each in springs]
    return min(levels, key=lambda trial: trial[0])


def _sprung(misfit: Misfit, present: Fit, begun: tuple[Array, Hypothesis]) -> Fit:
    theta, spring = begun
    return fit(misfit, theta, (*present.causes, spring), observer=present.observer, iterations=15)


def _windowed(misfit: Misfit) -> Misfit:
    """The misfit on the beginning of every record."""
    most = int(WINDOW * misfit.colour)
    return replace(misfit, n_train=tuple(min(n, most) for n in misfit.n_train))


def _level(misfit: Misfit, present: Fit, theta: Array, causes: Sequence[Hypothesis]) -> float:
    """-2 log posterior of parameters and causes."""
    e = misfit.residual(theta, causes, observer=present.observer)
    return objective(e, theta, misfit.parameters.precision, misfit.counting_as_one())


def _started_again(misfit: Misfit, present: Fit, level: float, theta: Array) -> tuple[float, Array]:
    """-2 log posterior and parameters with starts that suit them, the laws of force acting, too."""
    unknown = range(misfit.parameters.n_factors, misfit.parameters.n)
    P = misfit.parameters.precision[unknown.start :, unknown.start :]
    for _ in range(RESTARTS if np.isfinite(level) else 0):
        e = misfit.residual(theta, present.causes, observer=present.observer)
        w = weights(e, misfit.counting_as_one())[:, None]
        J = finite(theta_slopes(misfit, theta, present.causes, present.observer, e, None, unknown))
        A = (J * w).reshape(len(J), -1)
        moved, gradient = theta.copy(), A @ (e * w).ravel() + P @ theta[unknown]
        # Two unknowns of a start may have one response.
        moved[unknown] -= np.linalg.lstsq(A @ A.T + P, gradient, rcond=1e-10)[0]
        reached = _level(misfit, present, moved, present.causes)
        if not reached < level:
            break
        level, theta = reached, moved
    return level, theta


def _restarted(misfit: Misfit, theta: Array) -> Array:
    """The parameters with starts that suit them: those of another model fit nothing."""
    p = misfit.parameters
    if not p.started:
        return theta
    starts = best_starts(replace(misfit, twin=replace(misfit.twin, plant=misfit.plant(theta))))
    found = [starts[record] for record in p.started]
    return np.concatenate([theta[: p.n_factors], *found]) / np.concatenate(
        [np.ones(p.n_factors), p.widths[p.n_factors :]]
    )
