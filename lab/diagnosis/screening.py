"""Screening: every cause at every place, tried cheaply, and what the luckiest would have gained from noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.diagnosis.chance import NO_CHANCE, Chance
from lab.diagnosis.fit import cause_slopes, moved_by, objective, theta_slopes, weights
from lab.diagnosis.misfit import Hypothesis, Misfit
from lab.diagnosis.places import tone
from lab.effects.effect import Effect
from lab.hands import beside, shared

SCREEN_SAMPLES = 4096
SCREEN_SUBSTEPS = 3
"""Enough to rank causes by, where nothing else in the model has a law."""
STEPPED_ON, PLACES = 40, 8
"""Hypotheses that get more than one step in the screening; and places at which each cause does that begins at some size: it may
begin far off, and would not show beside causes that begin at none."""
MOST_STEPS = 4
AT_ONCE = 16
"""Hypotheses that are looked at in one piece of work."""
SCREEN_VALUES = 32768
"""Samples of all outputs together that are enough to rank causes by."""

_Start = tuple[Hypothesis, Array, Array, Array, float, float]
"""A hypothesis, its residual, what is left of it with the model's parameters projected out, these, objective, damping."""
_Look = tuple[Hypothesis, float, float]
"""A hypothesis, objective and damping: residuals of all hypotheses at once would fill the memory."""


@dataclass(frozen=True, eq=False)
class Screened:
    """Score of one hypothesis after a few steps from `theta` with the model's parameters projected out."""

    hypothesis: Hypothesis
    theta: Array
    score: float


@dataclass(frozen=True, eq=False)
class Screening:
    """What screening tells.

    Attributes:
        rows: hypotheses by falling score: the likelihood gained in a few steps, less the price of their variables.
        lucky: the best score that each of many draws of mere noise would have given.
        base: -2 log posterior that scores are counted from.
    """

    rows: list[Screened]
    lucky: Array
    base: float

    def beside(self, other: Screening) -> Screening:
        """Both, all scores counted from this one's base."""
        moved = [replace(row, score=row.score + self.base - other.base) for row in other.rows]
        return replace(self, rows=sorted(self.rows + moved, key=lambda row: -row.score))


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
    work: Work = UNHEARD,
    *,
    share: float = 1.0,
    places: int = PLACES,
) -> Screening:
    """Every hypothesis tried cheaply beside the causes present, and what the luckiest would have gained from noise.

    Args:
        misfit: model and data.
        theta: parameters of the model.
        present: causes so far.
        observer: gain that pulls the state to the measurements.
        proposed: causes to try.
        work: told of every hypothesis.
        share: of the samples that are usually looked at.
        places: where each cause that begins at some size is followed, besides the best of all.
    """
    most = int(share * min(SCREEN_SAMPLES, SCREEN_VALUES // misfit.measured.shape[0]))
    n_train = tuple(min(n, most) for n in misfit.n_train)
    if not misfit.plant(theta, present).laws:
        misfit = replace(misfit, substeps=SCREEN_SUBSTEPS)
    glance = Glance.beside(misfit, theta, tuple(present), observer, n_train)
    looking, following = work.parts(len(proposed), 2 * STEPPED_ON)
    pieces = [proposed[i : i + AT_ONCE] for i in range(0, len(proposed), AT_ONCE)]
    looks = [look for some in looking.each(shared(glance.looks, pieces), len(pieces)) for look in some]
    lucky = np.max([NO_CHANCE, *(each for _, each in looks)], axis=0)
    first = sorted((look for look, _ in looks), key=lambda look: -glance.score(look))
    chosen = _to_follow(first, places)
    few = [chosen[i : i + AT_ONCE // 4] for i in range(0, len(chosen), AT_ONCE // 4)]
    followed = following.each(shared(glance.followed, few), len(few))
    again = [look for some in followed for look in some]
    known = {id(look) for look in chosen}
    rows = [
        Screened(look[0], theta, glance.score(look))
        for look in again + [look for look in first if id(look) not in known]
    ]
    return Screening(sorted(rows, key=lambda row: -row.score), lucky, glance.base)


def _to_follow(looks: Sequence[_Look], places: int) -> list[_Look]:
    """The best of all, and the best of those that begin at some size at their places, of looks by falling score."""
    followed: dict[str, set[str]] = {}
    chosen = []
    for number, look in enumerate(looks):
        h = look[0]
        known = followed.setdefault(h.kind.cause, set())
        sized = any(h.guess.start.values()) and h.location not in known and len(known) < places
        if number < STEPPED_ON or sized:
            chosen.append(look)
            known.add(h.location)
    return chosen


@dataclass(frozen=True, eq=False)
class Glance:
    """What a cheap trial needs: the model where it stands, linearized in what it has already.

    Attributes:
        misfit: model and data.
        theta: parameters of the model.
        present: causes so far.
        observer: gain that pulls the state to the measurements.
        n_train: samples of each record that are looked at.
        base: -2 log posterior without a further cause.
        weights: one over the RMS of the residual, per channel.
        slopes: of the residual by parameters and causes so far, (n_variables, n_outputs, n).
        spread: inverse of their information with the prior, (n_variables, n_variables).
        chance: what noise would gain.
    """

    misfit: Misfit
    theta: Array
    present: tuple[Hypothesis, ...]
    observer: Array
    n_train: tuple[int, ...]
    base: float
    weights: Array
    slopes: Array
    spread: Array
    chance: Chance

    @classmethod
    def beside(
        cls,
        misfit: Misfit,
        theta: Array,
        present: tuple[Hypothesis, ...],
        observer: Array,
        n_train: tuple[int, ...],
    ) -> Glance:
        """A glance from the causes present."""
        e = misfit.residual(theta, present, observer=observer, n_train=n_train)
        slopes = np.concatenate(
            [
                theta_slopes(misfit, theta, present, observer, e, n_train),
                cause_slopes(misfit, theta, present, observer, e, n_train),
            ]
        )
        w = weights(e, misfit.colour)
        J = (slopes * w[:, None]).reshape(len(slopes), -1)
        information = J @ J.T
        information[: theta.size, : theta.size] += misfit.parameters.precision
        spread = np.asarray(np.linalg.pinv(information, rcond=1e-13, hermitian=True), dtype=np.float64)
        base = objective(e, theta, misfit.parameters.precision, misfit.colour)
        chance = Chance(e.shape, sum(misfit.n_train) * len(e))
        return cls(misfit, theta, present, observer, n_train, base, w, slopes, spread, chance)

    def score(self, look: _Look) -> float:
        """Likelihood gained, less the price of the variables."""
        h, f, _ = look
        found = self.base - f - max(h.n, 1) * float(np.log(self.slopes[0].size))
        return found if np.isfinite(found) else -np.inf

    def looks(self, proposed: Sequence[Hypothesis]) -> list[tuple[_Look, Array]]:
        """Each hypothesis after one step, and what it would have gained from noise."""
        return list(beside(self._look, proposed))

    def followed(self, looks: Sequence[_Look]) -> list[_Look]:
        """Each hypothesis after a few steps more."""
        return list(beside(self._follow, looks))

    def _look(self, h: Hypothesis) -> tuple[_Look, Array]:
        start = self._started(h, 1e-2)
        if not (h.n and np.isfinite(start[4])):
            return (h, *start[4:]), NO_CHANCE
        own, follow = self._own_slopes(h, start[1])
        if not np.all(np.isfinite(own)):
            # A step to the side diverges: nothing is known of where to go from here.
            return (h, *start[4:]), NO_CHANCE
        lucky = self.chance.tones if tone(h) is not None else self.chance.gains(own * self.weights[:, None])
        start = self._stepped(start, own, follow)
        return (start[0], *start[4:]), lucky

    def _follow(self, look: _Look) -> _Look:
        h, f, damping = look
        if not (h.n and np.isfinite(f)):
            return look
        start = self._started(h, damping)
        for _ in range(MOST_STEPS):
            before = start[4]
            start = self._stepped(start, *self._own_slopes(start[0], start[1]))
            if before - start[4] < 1:
                break
        return (start[0], *start[4:])

    def _started(self, h: Hypothesis, damping: float) -> _Start:
        r = self._residual(h)
        return (h, r, *self._projected(r), damping)

    def _residual(self, h: Hypothesis) -> Array:
        return self.misfit.residual(
            self.theta, [*self.present, h], observer=self.observer, n_train=self.n_train
        )

    @cached_property
    def _weighted(self) -> Array:
        """Slopes over the variance of each channel, a row for each variable: what they have in common with a residual."""
        return np.asarray((self.slopes * self.weights[:, None] ** 2).reshape(len(self.slopes), -1))

    def _projected(self, r: Array) -> tuple[Array, Array, float]:
        """Residual less what the model's parameters can explain of it, the parameters then, and the objective."""
        P, n = self.misfit.parameters.precision, self.theta.size
        gradient = self._weighted @ r.ravel()
        gradient[:n] += P @ self.theta
        d = -self.spread @ gradient
        left = r + np.tensordot(d, self.slopes, axes=1)
        return left, self.theta + d[:n], objective(left, self.theta + d[:n], P, self.misfit.colour)

    def _own_slopes(self, h: Hypothesis, r: Array) -> tuple[Array, Array]:
        """Slopes of the residual by a hypothesis' own variables, the model's parameters following, and slopes of these."""
        causes = [*self.present, h]
        own = cause_slopes(self.misfit, self.theta, causes, self.observer, r, self.n_train)[-h.n :]
        follow = -(own.reshape(h.n, -1) @ self._weighted.T) @ self.spread
        return own + np.tensordot(follow, self.slopes, axes=1), follow[:, : self.theta.size]

    def _stepped(self, started: _Start, own: Array, follow: Array) -> _Start:
        """A start after a Gauss-Newton step on its own variables; itself where none helps."""
        h, _, left, parameters, f, damping = started
        P, v = self.misfit.parameters.precision, weights(left, self.misfit.colour)
        A = (own * v[:, None]).reshape(h.n, -1)
        # What a cause explains, the parameters need not: the prior is relieved.
        G = A @ A.T + follow @ P @ follow.T
        g = A @ (left * v[:, None]).ravel() + follow @ P @ parameters
        if not (np.all(np.isfinite(G)) and np.trace(G) > 0):
            return started
        for _ in range(4):
            step = -np.linalg.solve(G + (damping * np.diag(np.diag(G)) + 1e-9 * np.trace(G) * np.eye(h.n)), g)
            (trial,) = moved_by([h], step)
            trial_r = self._residual(trial)
            trial_left, trial_parameters, trial_f = self._projected(trial_r)
            if trial_f < f:
                return trial, trial_r, trial_left, trial_parameters, trial_f, damping / 5
            damping = max(damping, 1e-2) * 10
        return started
