"""Lesson: how a model errs in frequency responses of a state in which nothing is wrong with it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.special

from identification.recording import Array
from lab.diagnosis.colour import colour
from lab.diagnosis.spectral.response_likelihood import ResponseLikelihood
from lab.diagnosis.spectral.transfer import Complex

LEVEL = 1e-3
"""Probability that as little as a baseline leaves is taken for more."""


@dataclass(frozen=True, eq=False)
class Lesson:
    """What a baseline teaches.

    Attributes:
        colour: lines whose errors are alike and count as one.
        power: squared error over squared response, both in units of the spread, (n_outputs, n_inputs).
        lines: of the baseline that count.
        floors: size of each response up to which errors are even, likewise.
    """

    colour: float
    power: Array
    lines: float
    floors: Array

    def heeded(self, likelihood: ResponseLikelihood) -> ResponseLikelihood:
        """The likelihood that expects the model to err by as large a share of the responses as it did."""
        return replace(
            likelihood,
            colour=self.colour,
            known_power=self.power * _response(likelihood),
            known_lines=self.lines,
        )

    def excess(
        self, likelihood: ResponseLikelihood, predicted: Complex
    ) -> tuple[float, tuple[int, int]] | None:
        """The response whose error exceeds that of the baseline most, and how often it does; None where none does.

        Errors of a model grow with the response, so shares are compared, by an F-test (Bonferroni over the responses).
        """
        power = _power(likelihood, predicted)
        n = 2 * len(likelihood.values) / self.colour
        limit = scipy.special.fdtri(n, 2 * self.lines, 1 - LEVEL / power.size)
        # Where neither errs, neither errs more.
        ratio = np.where(power > 0, np.inf, 1.0)
        np.divide(power, self.power, out=ratio, where=self.power > 0)
        output, column = np.unravel_index(np.argmax(ratio), ratio.shape)
        worst = float(ratio[output, column])
        return (np.sqrt(worst), (int(output), int(column))) if worst > limit else None


def lesson_of(likelihood: ResponseLikelihood, predicted: Complex, floors: Array) -> Lesson:
    """What the error of a calibrated model in a baseline teaches."""
    e = (likelihood.error(predicted) / likelihood.spread).reshape(len(likelihood.values), -1).T
    alike = colour(np.concatenate([e.real, e.imag]))
    return Lesson(alike, _power(likelihood, predicted), len(likelihood.values) / alike, floors)


def _power(likelihood: ResponseLikelihood, predicted: Complex) -> Array:
    return np.asarray(likelihood.power(predicted) / np.maximum(_response(likelihood), 1e-300))


def _response(likelihood: ResponseLikelihood) -> Array:
    return np.asarray(np.mean(np.abs(likelihood.values / likelihood.spread) ** 2, axis=0))
