"""Neighbourhood: the predictions of models near one, by steps of single parameters, small and large."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from identification.recording import Array
from lab.diagnosis.fit import STEP
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.spectral.transfer import Complex


class Trial(NamedTuple):
    """Parameters and nuisances, and the prediction there."""

    theta: Array
    nuisance: Array
    predicted: Complex


class Neighbourhood(Protocol):
    """What surrounds a point in the space of parameters."""

    def slopes(self, predicted: Complex) -> list[Complex]:
        """Derivative of the prediction by every parameter."""
        ...

    def along(self, direction: Array, factors: Array) -> Iterator[Trial]:
        """Models with all members of a direction multiplied by each of some factors."""
        ...


class Stepwise:
    """A neighbourhood that predicts every model anew."""

    def __init__(self, likelihood: Any, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> None:
        self._likelihood, self._theta, self._causes, self._nuisance = likelihood, theta, causes, nuisance

    def slopes(self, predicted: Complex) -> list[Complex]:
        """Derivative of the prediction by every parameter, by differences."""
        found = []
        for j in range(self._theta.size):
            theta = self._theta.copy()
            theta[j] += STEP
            found.append((self._predict(theta) - predicted) / STEP)
        return found

    def along(self, direction: Array, factors: Array) -> Iterator[Trial]:
        """Models with all members of a direction multiplied by each of some factors."""
        widths = self._likelihood.parameters.widths
        step = np.divide(direction, widths, where=direction != 0, out=np.zeros(direction.size))
        for factor in factors:
            theta = self._theta + np.log(factor) * step
            yield Trial(theta, self._nuisance, self._predict(theta))

    def _predict(self, theta: Array) -> Complex:
        return np.asarray(self._likelihood.predict(theta, self._causes, self._nuisance))
