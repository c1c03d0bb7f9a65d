"""Likelihood: what a model of spectra must offer so that fits, searches and evidence work on it.

Every kind of data has a prediction, a complex array, and a likelihood of it. Near a prediction -2 log L is quadratic:
`whitened` turns a change of the prediction into a row of real numbers such that products of rows are Fisher information.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from identification.recording import Array
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.spectral.neighbourhood import Neighbourhood
from lab.diagnosis.spectral.transfer import Complex
from lab.effects.survey import Survey
from lab.plant import Plant
from lab.twin import Twin


def explained(plant: Plant, causes: Sequence[Hypothesis], survey: Survey) -> Plant:
    """The plant with causes in it; an attached oscillator, which adds a degree of freedom, comes last."""
    for cause in sorted(causes, key=lambda c: c.kind.cause == "attached_oscillator"):
        plant = cause.effect.explain(plant, survey)
    return plant


class Likelihood(Protocol):
    """Data in the frequency domain against the twin of a model.

    Nuisances are what the data need and no model has, such as unknown intensities of forces and levels of noise; their
    prior is Gaussian about `nuisance_mean`.
    """

    twin: Twin
    parameters: Parameters
    survey: Survey
    nuisance_mean: Array
    nuisance_width: Array

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest and highest frequency of the data [Hz]."""
        ...

    def plant(self, theta: Array, causes: Sequence[Hypothesis] = ()) -> Plant:
        """The plant at parameters `theta` with causes in it."""
        ...

    def predict(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Complex:
        """The prediction; not finite where the parameters make no sense."""
        ...

    def around(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Neighbourhood:
        """Predictions of models near one."""
        ...

    def nuisance_slopes(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Complex:
        """Derivative of the prediction by every nuisance, (n_nuisances, *shape of the prediction)."""
        ...

    def deviance(self, predicted: Complex) -> float:
        """-2 log likelihood up to a constant; infinite where the prediction is impossible."""
        ...

    def whitened(self, predicted: Complex, changes: Complex) -> Array:
        """Changes (n, *shape of the prediction) as rows (n, n_values) whose products are Fisher information."""
        ...

    def error(self, predicted: Complex) -> Complex:
        """Prediction less data."""
        ...
