"""Glance: what a cheap trial of a cause needs, and the trial: a few steps with the model's own parameters projected out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.recording import Array
from lab.diagnosis.chance import NO_CHANCE, Chance
from lab.diagnosis.fit import cause_slopes, moved_by, objective, theta_slopes, weights
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.places import tone
from lab.hands import beside

MOST_STEPS = 4
_Start = tuple[Hypothesis, Array, Array, Array, float, float]
"""A hypothesis, its residual, what is left of it with the model's parameters projected out, these, objective, damping."""
Look = tuple[Hypothesis, float, float]
"""A hypothesis, objective and damping: residuals of all hypotheses at once would fill the memory."""


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
        counted = misfit.counting_as_one(n_train)
        w = weights(e, counted)
        J = (slopes * w[:, None]).reshape(len(slopes), -1)
        information = J @ J.T
        information[: theta.size, : theta.size] += misfit.parameters.precision
        spread = np.asarray(np.linalg.pinv(information, rcond=1e-13, hermitian=True), dtype=np.float64)
        base = objective(e, theta, misfit.parameters.precision, counted)
        chance = Chance(e.shape, sum(misfit.n_train) * len(e))
        return cls(misfit, theta, present, observer, n_train, base, w, slopes, spread, chance)

    def score(self, look: Look) -> float:
        """Likelihood gained, less the price of the variables."""
        h, f, _ = look
        found = self.base - f - max(h.n, 1) * float(np.log(self.slopes[0].size))
        return found if np.isfinite(found) else -np.inf

    def looks(self, proposed: Sequence[Hypothesis]) -> list[tuple[Look, Array]]:
        """Each hypothesis after one step, and what it would have gained from noise."""
        return list(beside(self._look, proposed))

    def followed(self, looks: Sequence[Look]) -> list[Look]:
        """Each hypothesis after a few steps more."""
        return list(beside(self._follow, looks))

    def _look(self, h: Hypothesis) -> tuple[Look, Array]:
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

    def _follow(self, look: Look) -> Look:
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
    def _counted(self) -> float | Array:
        """Samples that count as one."""
        return self.misfit.counting_as_one(self.n_train)

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
        return left, self.theta + d[:n], objective(left, self.theta + d[:n], P, self._counted)

    def _own_slopes(self, h: Hypothesis, r: Array) -> tuple[Array, Array]:
        """Slopes of the residual by a hypothesis' own variables, the model's parameters following, and slopes of these."""
        causes = [*self.present, h]
        own = cause_slopes(self.misfit, self.theta, causes, self.observer, r, self.n_train)[-h.n :]
        follow = -(own.reshape(h.n, -1) @ self._weighted.T) @ self.spread
        return own + np.tensordot(follow, self.slopes, axes=1), follow[:, : self.theta.size]

    def _stepped(self, started: _Start, own: Array, follow: Array) -> _Start:
        """A start after a Gauss-Newton step on its own variables; itself where none helps."""
        h, _, left, parameters, f, damping = started
        P, v = self.misfit.parameters.precision, weights(left, self._counted)
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
