"""Fit: maximum a posteriori of parameters, causes and nuisances in the frequency domain, by Fisher scoring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.recording import Array
from lab.diagnosis.fit import CAUSE_STEP, moved_by
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.spectral.likelihood import Likelihood
from lab.diagnosis.spectral.transfer import Complex


@dataclass(frozen=True, eq=False)
class SpectralFit:
    """Where a fit came to; what evidence asks of a fit has the names it has there.

    Attributes:
        theta: parameters of the model, in widths of the prior.
        causes: hypotheses at their fitted values.
        nuisance: likewise.
        residual: whitened error of the prediction, (1, n_values).
        objective: -2 log posterior up to a constant.
        information: of parameters, causes and nuisances, with the prior of the nuisances.
        precision: prior precision of the parameters.
    """

    theta: Array
    causes: tuple[Hypothesis, ...]
    nuisance: Array
    residual: Array
    objective: float
    information: Array
    precision: Array

    @property
    def deviance(self) -> float:
        """-2 log likelihood, up to the same constant; nuisances pay their prior in it."""
        return self.objective - float(self.theta @ self.precision @ self.theta)

    @property
    def covariance(self) -> Array:
        """Of all variables: parameters in widths of the prior, causes in units of their scale, nuisances as they are."""
        total = self.information.copy()
        total[: self.theta.size, : self.theta.size] += self.precision
        return np.asarray(np.linalg.pinv(total, rcond=1e-14, hermitian=True), dtype=np.float64)

    @property
    def n_structural(self) -> int:
        """Parameters whose common spread the data tell: all of them."""
        return self.theta.size


@dataclass(frozen=True, eq=False)
class Point:
    """Values of all variables, the prediction there, and -2 log posterior."""

    theta: Array
    causes: tuple[Hypothesis, ...]
    nuisance: Array
    predicted: Complex
    objective: float

    def moved(self, likelihood: Likelihood, step: Array) -> Point:
        """The point a step away."""
        n, last = self.theta.size, step.size - self.nuisance.size
        causes = moved_by(self.causes, step[n:last])
        return point(likelihood, self.theta + step[:n], causes, self.nuisance + step[last:])


def point(likelihood: Likelihood, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Point:
    """The prediction and -2 log posterior at given values."""
    predicted = likelihood.predict(theta, causes, nuisance)
    level = objective(likelihood, theta, nuisance, predicted)
    return Point(theta, tuple(causes), nuisance, predicted, level)


def objective(likelihood: Likelihood, theta: Array, nuisance: Array, predicted: Complex) -> float:
    """-2 log posterior of values and their prediction, up to a constant."""
    off = (nuisance - likelihood.nuisance_mean) / likelihood.nuisance_width
    prior = float(theta @ likelihood.parameters.precision @ theta + off @ off)
    deviance = likelihood.deviance(predicted) if np.all(np.isfinite(predicted)) else np.inf
    return deviance + prior


def slopes(likelihood: Likelihood, at: Point) -> Array:
    """Whitened derivative of the prediction by every variable, (n_variables, n_values)."""
    near = likelihood.around(at.theta, at.causes, at.nuisance)
    changes = [*near.slopes(at.predicted), *_cause_slopes(likelihood, at)]
    nuisance = likelihood.nuisance_slopes(at.theta, at.causes, at.nuisance)
    shape = at.predicted.shape
    changes += [np.broadcast_to(each, shape) for each in nuisance]
    return likelihood.whitened(at.predicted, np.stack(changes))


def whitened_error(likelihood: Likelihood, at: Point) -> Array:
    """Whitened error of the prediction, (n_values,)."""
    return np.asarray(likelihood.whitened(at.predicted, likelihood.error(at.predicted)[None])[0])


def fit(
    likelihood: Likelihood,
    theta: Array,
    causes: Sequence[Hypothesis],
    nuisance: Array,
    *,
    iterations: int = 20,
    tolerance: float = 0.05,
) -> SpectralFit:
    """Parameters, causes and nuisances at the most likely values near where they start.

    Args:
        likelihood: model and data.
        theta: parameters at the start.
        causes: hypotheses at the start.
        nuisance: likewise.
        iterations: at most.
        tolerance: stop when an iteration gains less than this in -2 log posterior.

    Source: Levenberg-Marquardt steps on the Fisher information (Osborne 1992, Int. Stat. Rev. 60).
    """
    now = point(likelihood, np.asarray(theta, dtype=float), causes, nuisance)
    damping = 1e-3
    for _ in range(iterations):
        g, H = system(likelihood, now, slopes(likelihood, now), whitened_error(likelihood, now))
        if not (np.all(np.isfinite(H)) and np.all(np.isfinite(g))):
            break
        gained = 0.0
        # A variable without any effect has no scale of its own, and stays.
        scale = np.sqrt(np.where(np.diag(H) > 0, np.diag(H), 1.0))
        for _ in range(8):
            step = (
                -np.linalg.solve(H / np.outer(scale, scale) + damping * np.eye(scale.size), g / scale) / scale
            )
            trial = now.moved(likelihood, np.clip(step, -MOST, MOST))
            if trial.objective < now.objective:
                gained, now, damping = now.objective - trial.objective, trial, max(damping / 10, 1e-7)
                break
            damping = max(damping, 1e-4) * 10
        if gained < tolerance:
            break
    _, H = system(likelihood, now, slopes(likelihood, now), whitened_error(likelihood, now))
    n = now.theta.size
    H[:n, :n] -= likelihood.parameters.precision
    residual = whitened_error(likelihood, now)[None]
    return SpectralFit(
        now.theta, now.causes, now.nuisance, residual, now.objective, H, likelihood.parameters.precision
    )


MOST = 8.0
"""Longest step of a variable: in widths of the prior, scales of a cause, or logarithms of power."""


def system(likelihood: Likelihood, at: Point, J: Array, error: Array) -> tuple[Array, Array]:
    """Half the gradient of -2 log posterior, and the information, both with the priors."""
    n, size = at.theta.size, len(J)
    last = size - at.nuisance.size
    prior = np.zeros((size, size))
    prior[:n, :n] = likelihood.parameters.precision
    prior[range(last, size), range(last, size)] = likelihood.nuisance_width**-2.0
    off = np.concatenate([at.theta, np.zeros(last - n), at.nuisance - likelihood.nuisance_mean])
    return J @ error + prior @ off, J @ J.T + prior


def _cause_slopes(likelihood: Likelihood, at: Point) -> list[Complex]:
    found = []
    for i, cause in enumerate(at.causes):
        for j in range(cause.n):
            sides = []
            for step in (CAUSE_STEP, -CAUSE_STEP):
                values = cause.values.copy()
                values[j] += step
                causes = [*at.causes[:i], cause.at(values), *at.causes[i + 1 :]]
                sides.append((likelihood.predict(at.theta, causes, at.nuisance) - at.predicted) / step)
            # A delay may not be negative, and jumps where it passes a whole sample.
            found.append(
                min(sides, key=lambda side: float(np.nan_to_num(np.sum(np.abs(side) ** 2), nan=np.inf)))
            )
    return found
