"""Fit: maximum a posteriori of the model's parameters and of causes, by Levenberg and Marquardt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.recording import Array
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.misfit import Misfit
from lab.forces import KINKED
from lab.hands import beside
from lab.responder import NO_OBSERVER

STEP, KINKED_STEP, CAUSE_STEP = 1e-3, 3e-2, 1e-3
"""Difference steps: in widths of the prior, so small that valleys are followed, but wide enough to see past the jags that kinks
make; and in units of a cause's scale."""
EASED, KINKED_EASED, LEAST = 30.0, 8.0, 1e-8
"""Damping falls by so much after a good step, and so far: along a valley where only the prior tells, such as all masses,
stiffnesses and dampings against the gain of the only actuator, the curvature is that much less than across.
Jags ask for caution."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a fit came to.

    Attributes:
        theta: parameters of the model, in widths of the prior.
        causes: hypotheses at their fitted values.
        residual: measured less predicted, (n_outputs, n_total).
        objective: -2 log posterior up to a constant: n log of every channel's residual power, plus θᵀ P θ.
        information: Gauss-Newton information of all variables without the prior, (n, n).
        precision: P, of the prior, (n_parameters, n_parameters).
        observer: gain that pulled the state to the measurements; no rows for the plain simulation error.
        n_structural: parameters, the first, whose common spread the data tell; the widths of others are as stated.
    """

    theta: Array
    causes: tuple[Hypothesis, ...]
    residual: Array
    objective: float
    information: Array
    precision: Array
    observer: Array
    n_structural: int

    @property
    def deviance(self) -> float:
        """-2 log likelihood, up to the same constant."""
        return self.objective - float(self.theta @ self.precision @ self.theta)

    @property
    def covariance(self) -> Array:
        """Of all fitted variables: parameters in widths of the prior, causes in units of their scale."""
        total = self.information.copy()
        total[: self.theta.size, : self.theta.size] += self.precision
        return np.asarray(np.linalg.pinv(total, rcond=1e-14, hermitian=True), dtype=np.float64)


def objective(residual: Array, theta: Array, precision: Array, counted: float | Array = 1.0) -> float:
    """-2 log posterior with the noise of every channel at its most likely level; `counted` samples count as one."""
    # A trial far from any sense may overflow before it diverges.
    with np.errstate(over="ignore"):
        power = np.mean(residual**2, axis=1)
    if not np.all(np.isfinite(power)):
        return np.inf
    levels = residual.shape[1] / counted * np.log(np.maximum(power, 1e-300))
    return float(np.sum(levels) + theta @ precision @ theta)


def weights(residual: Array, counted: float | Array = 1.0) -> Array:
    """One over the residual's RMS, per channel; `counted` samples count as one."""
    return 1 / np.sqrt(np.maximum(counted * np.mean(residual**2, axis=1), 1e-300))


def theta_slopes(
    misfit: Misfit,
    theta: Array,
    causes: Sequence[Hypothesis],
    observer: Array,
    residual: Array,
    n_train: Sequence[int] | None,
    which: Sequence[int] | None = None,
) -> Array:
    """Derivative of the residual by every parameter, or by some of them, (n_parameters, n_outputs, n_total)."""
    step = KINKED_STEP if _kinked(misfit, theta, causes) else STEP
    numbers = range(theta.size) if which is None else which
    slopes = np.empty((len(numbers), *residual.shape))

    def slope(row: int) -> None:
        moved = theta.copy()
        moved[numbers[row]] += step
        # In place: all slopes together are large, and a copy of them takes as long as some responses.
        np.subtract(
            misfit.residual(moved, causes, observer=observer, n_train=n_train), residual, out=slopes[row]
        )
        slopes[row] /= step

    for _ in beside(slope, range(len(numbers))):
        pass
    return slopes


def cause_slopes(
    misfit: Misfit,
    theta: Array,
    causes: Sequence[Hypothesis],
    observer: Array,
    residual: Array,
    n_train: Sequence[int] | None,
) -> Array:
    """Derivative of the residual by every variable of the causes, (n_variables, n_outputs, n_total)."""
    kinked = _kinked(misfit, theta, causes)
    slopes = []
    for i, cause in enumerate(causes):
        for j, name in enumerate(cause.guess.scale):
            sides = []
            both = kinked or name == "delay"
            for step in (CAUSE_STEP, -CAUSE_STEP) if both else (CAUSE_STEP,):
                values = cause.values.copy()
                values[j] += step
                moved = [*causes[:i], cause.at(values), *causes[i + 1 :]]
                sides.append(
                    (misfit.residual(theta, moved, observer=observer, n_train=n_train) - residual) / step
                )
            # A delay jumps where it passes a whole sample, and a kink makes jags: the smaller slope does not cross one.
            slopes.append(min(sides, key=lambda side: float(np.nan_to_num(np.sum(side**2), nan=np.inf))))
    return np.array(slopes).reshape(-1, *residual.shape)


def _kinked(misfit: Misfit, theta: Array, causes: Sequence[Hypothesis]) -> bool:
    """Whether a law with kinks is in the plant."""
    return any(law.kind in KINKED for law in misfit.plant(theta, causes).laws)


def finite(slopes: Array) -> Array:
    """Slopes with zeros where a step to the side diverges: nothing is known of that variable and it stays."""
    known = np.all(np.isfinite(slopes), axis=(1, 2))
    return slopes if np.all(known) else np.where(known[:, None, None], slopes, 0.0)


class _Linear:
    """Slopes of the parameters and what they have in common, channel by channel, for as long as the slopes are kept."""

    def __init__(self, slopes: Array) -> None:
        slopes = finite(slopes)
        self.rows = slopes.reshape(len(slopes), slopes.shape[1] * slopes.shape[2])
        # (n_outputs, n_parameters, n_parameters)
        self.products = np.matmul(slopes.transpose(1, 0, 2), slopes.transpose(1, 2, 0))

    def beside(self, own: Array, residual: Array, w: Array) -> tuple[Array, Array]:
        """Information and gradient of parameters and causes, whose slopes are `own`, with channels weighted by `w`."""
        n, size = len(self.rows), len(self.rows) + len(own)
        flat = own.reshape(len(own), residual.size)
        weighted = (own * w[:, None] ** 2).reshape(flat.shape)
        information = np.empty((size, size))
        information[:n, :n] = np.tensordot(w**2, self.products, axes=1)
        information[:n, n:] = self.rows @ weighted.T
        information[n:, :n] = information[:n, n:].T
        information[n:, n:] = flat @ weighted.T
        r = (residual * w[:, None] ** 2).ravel()
        return information, np.concatenate([self.rows @ r, flat @ r])


def moved_by(causes: Sequence[Hypothesis], step: Array) -> tuple[Hypothesis, ...]:
    """The causes with a step added to all their variables."""
    ends = np.cumsum([cause.n for cause in causes])
    parts = np.split(step, ends[:-1]) if causes else []
    return tuple(cause.at(cause.values + part) for cause, part in zip(causes, parts, strict=True))


def fit(
    misfit: Misfit,
    theta: Array,
    causes: Sequence[Hypothesis] = (),
    *,
    observer: Array = NO_OBSERVER,
    iterations: int = 8,
    refresh: int = 2,
    tolerance: float = 0.5,
    n_train: Sequence[int] | None = None,
    slopes: Array | None = None,
) -> Fit:
    """Parameters and causes at the most likely values near where they start.

    Args:
        misfit: model and data.
        theta: parameters at the start.
        causes: hypotheses at the start.
        observer: gain that pulls the state to the measurements; none for the plain simulation error.
        iterations: at most.
        refresh: iterations for which slopes of the parameters are kept.
        tolerance: stop when an iteration with fresh slopes gains less than this in -2 log posterior.
        n_train: samples of each record to use; all training samples when None.
        slopes: of the residual by the parameters, of a model close to the one at the start, (n_parameters, n_outputs, n_total);
            they count as one iteration old.
    """
    causes = tuple(causes)
    theta = np.asarray(theta, dtype=float)
    n = theta.size
    e = misfit.residual(theta, causes, observer=observer, n_train=n_train)
    P, counted = misfit.parameters.precision, misfit.counting_as_one(n_train)
    f, damping = objective(e, theta, P, counted), 1e-3
    age = refresh if slopes is None else 1
    linear = _Linear(np.zeros((0, *e.shape)) if slopes is None else slopes)
    size = n + sum(cause.n for cause in causes)
    prior = np.zeros((size, size))
    prior[:n, :n] = P
    information = np.zeros((size, size))
    eased = KINKED_EASED if _kinked(misfit, theta, causes) else EASED
    for _ in range(iterations):
        if age >= refresh:
            linear, age = _Linear(theta_slopes(misfit, theta, causes, observer, e, n_train)), 0
        fresh = age == 0
        age += 1
        w = weights(e, counted)
        own = finite(cause_slopes(misfit, theta, causes, observer, e, n_train))
        information, g = linear.beside(own, e, w)
        H = information + prior
        g = g + prior[:, :n] @ theta
        if not (np.isfinite(f) and np.all(np.isfinite(H))):
            break
        # A cause can stop at an edge, such as a delay of a whole sample: then the parameters go on without it.
        for free in (np.arange(size), np.arange(n)) if causes else (np.arange(size),):
            step = None
            for _ in range(6):
                scaled = H + damping * np.diag(np.diag(H)) + 1e-12 * np.trace(H) * np.eye(size)
                d = np.zeros(size)
                d[free] = -np.linalg.solve(scaled[np.ix_(free, free)], g[free])
                d *= misfit.parameters.allowed(d[:n])
                trial, trial_causes = theta + d[:n], moved_by(causes, d[n:])
                trial_e = misfit.residual(trial, trial_causes, observer=observer, n_train=n_train)
                trial_f = objective(trial_e, trial, P, counted)
                if trial_f < f:
                    step = f - trial_f
                    break
                damping = max(damping, 1e-3) * 8
            if step is not None:
                break
            damping = 1e-3
        if step is None:
            if fresh:
                break
            age, damping = refresh, 1e-2
            continue
        theta, causes, e, f, damping = trial, trial_causes, trial_e, trial_f, max(damping / eased, LEAST)
        if step < tolerance:
            if fresh:
                break
            age = refresh
    return Fit(theta, causes, e, f, information, P, observer, misfit.parameters.n_structural)


def resumed(misfit: Misfit, found: Fit, *, iterations: int, refresh: int = 2, tolerance: float = 0.5) -> Fit:
    """A fit gone on with, perhaps of another misfit: with other priors, or finer substeps."""
    return fit(
        misfit,
        found.theta,
        found.causes,
        observer=found.observer,
        iterations=iterations,
        refresh=refresh,
        tolerance=tolerance,
    )
