"""ResponseLikelihood: measured frequency responses against the twin of a model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from identification.recording import Array
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.spectral.likelihood import explained
from lab.diagnosis.spectral.nearby import Nearby, shares_of
from lab.diagnosis.spectral.neighbourhood import Neighbourhood, Stepwise, Trial
from lab.diagnosis.spectral.scale import LOOSE, Scale
from lab.diagnosis.spectral.transfer import Complex, plant_response
from lab.effects.survey import Survey
from lab.plant import Plant
from lab.twin import Twin


@dataclass(frozen=True, eq=False)
class ResponseLikelihood:
    """Frequency responses against the twin of a model; noise of every pair of channels at its most likely level.

    Nuisances are the factors on the responses that nobody knows.

    Attributes:
        twin: of the model.
        parameters: of the model.
        survey: of rig and data.
        frequency_hz: (n_f,).
        values: (n_f, n_outputs, n_inputs).
        spread: standard deviation of each value but for one factor per pair, likewise.
        decay: rate of the exponential window behind the responses [1/s].
        dt: sample time [s]; zero for forces that vary continuously.
        scale: unknown factors.
        colour: lines whose errors are alike and count as one.
        known_power: squared error of every pair that was seen elsewhere, in units of the spread, (n_outputs, n_inputs).
        known_lines: how many independent lines told it; none where nothing is known.
    """

    twin: Twin
    parameters: Parameters
    survey: Survey
    frequency_hz: Array
    values: Complex
    spread: Array
    decay: float
    dt: float
    scale: Scale
    colour: float = 1.0
    known_power: Array | float = 0.0
    known_lines: float = 0.0

    @property
    def nuisance_mean(self) -> Array:
        """Where the factors are estimated."""
        return np.zeros(self.scale.n)

    @property
    def nuisance_width(self) -> Array:
        """Hardly any prior."""
        return np.full(self.scale.n, LOOSE)

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest and highest frequency of the data [Hz]."""
        return float(self.frequency_hz[0]), float(self.frequency_hz[-1])

    @property
    def s(self) -> Complex:
        """Complex frequencies at which the structure responds so [rad/s]."""
        # Under e^{-γt} on forces and readings alike every pole moves by -γ: H(s) is seen at s + γ.
        return np.asarray(2j * np.pi * self.frequency_hz + self.decay, dtype=np.complex128)

    def plant(self, theta: Array, causes: Sequence[Hypothesis] = ()) -> Plant:
        """The plant at parameters `theta` with causes in it."""
        return explained(self.twin.changed(*self.parameters.factors(theta)), causes, self.survey)

    def predict(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Complex:
        """H of the model times the unknown factors, (n_f, n_outputs, n_inputs)."""
        return self.scale.applied(self.unscaled(theta, causes), nuisance)

    def unscaled(self, theta: Array, causes: Sequence[Hypothesis]) -> Complex:
        """H of the model, (n_f, n_outputs, n_inputs)."""
        plant = self.plant(theta, causes)
        H = plant_response(plant, np.asarray(self.s / (2j * np.pi)), dt=self.dt)
        return H[:, :, : len(plant.inputs)]

    def nuisance_slopes(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Complex:
        """Derivative of the prediction by real and imaginary part of every unknown factor."""
        if not self.scale.n:
            return np.zeros((0, *self.values.shape), dtype=complex)
        return self.scale.slopes(self.unscaled(theta, causes))

    def around(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Neighbourhood:
        """Predictions of models near one."""
        if self.dt:
            return Stepwise(self, theta, causes, nuisance)
        return _Continuous(self, theta, causes, nuisance)

    def deviance(self, predicted: Complex) -> float:
        """2 n Σ log σ² over all pairs, their noise at its most likely level; n counts what is known of it already.

        Source: Pintelon and Schoukens (2012), System Identification, 2nd ed., section 9.2, the variance unknown.
        """
        level = self.level(predicted)
        if not np.all(np.isfinite(level)):
            return np.inf
        n = self.frequency_hz.size / self.colour + self.known_lines
        return float(2 * n * np.sum(np.log(np.maximum(level, 1e-300))))

    def whitened(self, predicted: Complex, changes: Complex) -> Array:
        """Changes over their standard deviation, real and imaginary parts."""
        rows = np.sqrt(2 / self.colour) * changes / (self.spread * np.sqrt(self.level(predicted)))
        rows = rows.reshape(len(changes), -1)
        return np.concatenate([rows.real, rows.imag], axis=1)

    def error(self, predicted: Complex) -> Complex:
        """H of the model less H measured."""
        return np.asarray(predicted - self.values)

    def power(self, predicted: Complex) -> Array:
        """Mean squared error of every pair in units of its spread, (n_outputs, n_inputs)."""
        return np.asarray(np.mean(np.abs(self.error(predicted) / self.spread) ** 2, axis=0))

    def level(self, predicted: Complex) -> Array:
        """Most likely mean squared error of every pair, from these lines and what is known, (n_outputs, n_inputs)."""
        n = self.frequency_hz.size / self.colour
        known = self.known_lines * self.known_power
        return np.asarray((n * self.power(predicted) + known) / (n + self.known_lines))


class _Continuous:
    """The neighbourhood of a model with continuous forces, from one inversion of its dynamic stiffness."""

    def __init__(
        self,
        likelihood: ResponseLikelihood,
        theta: Array,
        causes: Sequence[Hypothesis],
        nuisance: Array,
    ) -> None:
        self._likelihood, self._theta, self._causes, self._nuisance = likelihood, theta, causes, nuisance
        plant = likelihood.plant(theta, causes)
        self._inputs = len(plant.inputs)
        self._nearby = Nearby(plant, likelihood.s, shares_of(likelihood.twin))

    def slopes(self, predicted: Complex) -> list[Complex]:
        """Derivative of the prediction by every parameter."""
        factors = self._factors(self._theta)
        # A factor that has come to its end moves no further.
        moves = self._factors(self._theta + 1e-6) != factors
        rates = self._likelihood.parameters.widths * factors * moves
        scale = self._likelihood.scale
        return [
            scale.applied(rate * self._nearby.slope(j)[:, :, : self._inputs], self._nuisance)
            for j, rate in enumerate(rates)
        ]

    def along(self, direction: Array, factors: Array) -> Iterator[Trial]:
        """Models with all members of a direction multiplied by each of some factors, unknown scales fitted anew."""
        known, widths = self._likelihood, self._likelihood.parameters.widths
        step = np.divide(direction, widths, where=direction != 0, out=np.zeros(direction.size))
        thetas = [self._theta + np.log(factor) * step for factor in factors]
        for theta, H in zip(thetas, self._responses(list(np.flatnonzero(direction)), thetas), strict=True):
            nuisance = known.scale.fitted(H, known.values, known.spread)
            yield Trial(theta, nuisance, known.scale.applied(H, nuisance))

    def _responses(self, members: list[int], thetas: Sequence[Array]) -> Iterator[Complex]:
        if len(members) > 1:
            yield from (self._likelihood.unscaled(theta, self._causes) for theta in thetas)
            return
        (j,) = members
        # Shares have their nominal size: what a factor adds to it counts from 1.
        added = np.array([self._factors(theta)[j] for theta in thetas]) - self._factors(self._theta)[j]
        yield from (H[:, :, : self._inputs] for H in self._nearby.with_factors(j, 1 + added))

    def _factors(self, theta: Array) -> Array:
        return np.concatenate(self._likelihood.parameters.factors(theta))
