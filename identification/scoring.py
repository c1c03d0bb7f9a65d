"""The maximum of a likelihood by Fisher scoring: Gauss-Newton steps, shortened where they do not help.

Each record and output has noise of its own, unknown size. At its best value the log-likelihood is
-½ Σ N ln(squares / N), and its expected curvature is the Fisher information at that noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.output_error import OutputError
from identification.recording import Array

TOLERANCE = 1e-8
"""Squared distance to the maximum, in standard deviations, at which to stop."""

GOOD_ENOUGH = 1e-4
"""The same, at which to be content when rounding allows no further step."""

PRECISION = 1e-10
"""Noise relative to the signal below which data count as exact; keeps weights finite."""

BLIND = 1e-11
"""Information of a combination of scaled parameters below which rounding decides, relative to the largest."""

MAX_DAMPING = 1e8


@dataclass(frozen=True, eq=False)
class Noise:
    """How noise variances follow from squared errors.

    Attributes:
        n_samples: samples measured in each record and output, shape (n_records, n_outputs).
        floor: smallest variance, shape (n_records, n_outputs).
        per_record: whether each record has its own, or all share one for each output.
    """

    n_samples: Array
    floor: Array
    per_record: bool

    def variance(self, squares: Array) -> Array:
        """Variance of each record and output, shape (n_records, n_outputs)."""
        if self.per_record:
            return squares / np.maximum(self.n_samples, 1) + self.floor
        total = np.sum(self.n_samples, axis=0)
        pooled = np.sum(squares + self.n_samples * self.floor, axis=0) / np.maximum(total, 1)
        return np.broadcast_to(pooled, squares.shape)

    def cost(self, squares: Array) -> float:
        """Minus the log-likelihood, but for a constant; infinite where no model exists."""
        if not np.all(np.isfinite(squares)):
            return np.inf
        return float(0.5 * np.sum(self.n_samples * np.log(self.variance(squares))))


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where the search ended.

    Attributes:
        q: the unknowns.
        squares: squared errors there, shape (n_records, n_outputs).
        information: Fisher information there, shape (n_unknowns, n_unknowns).
        n_iterations: Gauss-Newton steps taken.
        distance: to the maximum, in standard deviations, by the last step computed.
        converged: whether this is as good as zero.
    """

    q: Array
    squares: Array
    information: Array
    n_iterations: int
    distance: float
    converged: bool


@dataclass(frozen=True, eq=False)
class Curvature:
    """An information matrix in the coordinates in which its diagonal is one.

    Attributes:
        scale: square roots of its diagonal, one where that is zero.
        eigenvalues: of the scaled matrix, rising.
        eigenvectors: of the scaled matrix, in columns.
    """

    scale: Array
    eigenvalues: Array
    eigenvectors: Array

    @classmethod
    def of(cls, information: Array) -> Curvature:
        """The decomposition."""
        scale = np.sqrt(np.diag(information))
        scale = np.where(scale > 0, scale, 1.0)
        return cls(scale, *np.linalg.eigh(information / scale / scale[:, None]))

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which eigenvectors the data say something about."""
        return np.asarray(self.eigenvalues > BLIND * self.eigenvalues[-1])

    def solve(self, gradient: Array, damping: float = 0.0) -> Array:
        """(H + damping · diag H)⁻¹ g, and nothing where the data are blind."""
        along = self.eigenvectors.T @ (gradient / self.scale)
        length = np.where(self.seen, along / np.where(self.seen, self.eigenvalues + damping, 1.0), 0.0)
        return np.asarray(self.eigenvectors @ length / self.scale)


def noise_model(problem: OutputError, *, per_record: bool) -> Noise:
    """The noise of a problem, with a floor relative to the size of each signal.

    Args:
        problem: records and family of models.
        per_record: whether the noise of an output may differ from record to record.

    Returns:
        How variances follow from squared errors.

    Raises:
        IdentificationError: all outputs are zero.
    """
    power = problem.power
    if not np.any(power):
        raise IdentificationError("all outputs are zero, so there is nothing to fit; check the recording")
    return Noise(problem.n_samples, PRECISION**2 * power, per_record)


def maximize(problem: OutputError, noise: Noise, start: Array, *, max_iterations: int = 100) -> Optimum:
    """The most likely unknowns near the start.

    Args:
        problem: records and family of models.
        noise: noise model.
        start: unknowns to begin with, shape (n_unknowns,).
        max_iterations: steps after which to give up.

    Returns:
        Where the search ended.

    Raises:
        IdentificationError: the model of the start cannot be simulated.

    Source: Osborne (1992), Int. Stat. Rev. 60(1), Fisher's method of scoring; Marquardt (1963), J. SIAM 11(2),
    for the damping.
    """

    def look(q: Array) -> _Point:
        squares = problem.squares(q)
        return _Point(q, squares, noise.cost(squares))

    here, damping, iteration = look(start), 0.0, 0
    if not np.isfinite(here.cost):
        raise IdentificationError(
            "the model of the start grows beyond all bounds within a record; start from a stable one"
        )
    while True:
        gradient, information = problem.normal_equations(here.q, 1 / noise.variance(here.squares))
        curvature = Curvature.of(information)
        distance2 = max(float(gradient @ curvature.solve(gradient)), 0.0)
        done = distance2 < TOLERANCE
        if done or iteration == max_iterations:
            break
        near = distance2 < GOOD_ENOUGH
        better, damping = _improve(look, here, gradient, curvature, 0.0 if near else damping, near)
        if better is None:
            done = near
            break
        here, iteration = better, iteration + 1
    return Optimum(here.q, here.squares, information, iteration, float(np.sqrt(distance2)), done)


class _Point(NamedTuple):
    """Unknowns, their squared errors (infinite where no model exists) and minus their log-likelihood."""

    q: Array
    squares: Array
    cost: float


def _improve(
    look: Callable[[Array], _Point],
    here: _Point,
    gradient: Array,
    curvature: Curvature,
    damping: float,
    near: bool,
) -> tuple[_Point | None, float]:
    """A point of less cost, None where rounding hides it, and the damping to go on with.

    Near the maximum nothing but rounding asks for damping, so none is tried there.
    """
    while damping <= (0 if near else MAX_DAMPING):
        step = curvature.solve(gradient, damping)
        there, slope = look(here.q + step), float(gradient @ step)
        if there.cost < here.cost:
            if here.cost - there.cost > slope / 4:
                damping = damping / 10 if damping > 1e-5 else 0.0
            return _stretch(look, here, there, slope), damping
        damping = max(10 * damping, 1e-4)
    return None, damping


def _stretch(look: Callable[[Array], _Point], here: _Point, there: _Point, slope: float) -> _Point:
    """The better of a step and its best multiple by the parabola through what is known of the cost.

    The true curvature departs from the expected one where noise is strong; this makes up for it.
    """
    bend = 2 * (slope - (here.cost - there.cost))
    length = slope / max(bend, slope / 4)
    if abs(length - 1) < 0.1:
        return there
    further = look(here.q + length * (there.q - here.q))
    return further if further.cost < there.cost else there


def solve_linear(problem: OutputError, start: Array, which: NDArray[np.bool_]) -> Array:
    """The start with those unknowns at their best on which the outputs depend linearly.

    Args:
        problem: records and family of models.
        start: unknowns, shape (n_unknowns,).
        which: mask of the linear ones.

    Returns:
        Shape (n_unknowns,).
    """
    gradient, information = problem.normal_equations(start, 1 / problem.power)
    best = start.copy()
    best[which] += Curvature.of(information[np.ix_(which, which)]).solve(gradient[which])
    return best
