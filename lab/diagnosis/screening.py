"""Screening: every cause at every place, tried cheaply, and what the luckiest would have gained from noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.diagnosis.chance import NO_CHANCE, Chance
from lab.diagnosis.fit import POOL, cause_slopes, moved_by, objective, theta_slopes, weights
from lab.diagnosis.misfit import Hypothesis, Misfit
from lab.diagnosis.places import tone
from lab.effects.effect import Effect

SCREEN_SAMPLES = 4096
SCREEN_SUBSTEPS = 3
"""Enough to rank causes by, where nothing else in the model has a law."""
STEPPED_ON = 40
"""Hypotheses that get more than one step in the screening."""

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
    """
    most = int(share * min(SCREEN_SAMPLES, SCREEN_VALUES // misfit.measured.shape[0]))
    n_train = tuple(min(n, most) for n in misfit.n_train)
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

    def score(look: _Look) -> float:
        h, f, _ = look
        found = base - f - max(h.n, 1) * float(np.log(e.size))
        return found if np.isfinite(found) else -np.inf

    def started(h: Hypothesis, damping: float) -> _Start:
        r = misfit.residual(theta, [*present, h], observer=observer, n_train=n_train)
        return (h, r, *projected(r), damping)

    def looked_at(h: Hypothesis) -> tuple[_Look, Array]:
        """A hypothesis after one step, and what it would have gained from noise."""
        start = started(h, 1e-2)
        if not (h.n and np.isfinite(start[4])):
            return (h, *start[4:]), NO_CHANCE
        own, follow = own_slopes(h, start[1])
        lucky = chance.tones if tone(h) is not None else chance.gains(own * w[:, None])
        start = stepped(start, own, follow)
        return (start[0], *start[4:]), lucky

    def followed(look: _Look) -> _Look:
        """A hypothesis after a few steps more."""
        h, f, damping = look
        if not (h.n and np.isfinite(f)):
            return look
        start = started(h, damping)
        for _ in range(3):
            before = start[4]
            start = stepped(start, *own_slopes(start[0], start[1]))
            if before - start[4] < 1:
                break
        return (start[0], *start[4:])

    looking, following = work.parts(len(proposed), STEPPED_ON)
    looks = list(looking.each(POOL.map(looked_at, proposed), len(proposed)))
    lucky = np.max([NO_CHANCE, *(each for _, each in looks)], axis=0)
    first = sorted((look for look, _ in looks), key=lambda look: -score(look))
    again = list(following.each(POOL.map(followed, first[:STEPPED_ON]), STEPPED_ON))
    rows = [Screened(look[0], theta, score(look)) for look in again + first[STEPPED_ON:]]
    return Screening(sorted(rows, key=lambda row: -row.score), lucky, base)
