"""Responses: measured frequency responses, as an experiment in the frequency domain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.stats

from identification.recording import Array
from identification.response import FrequencyResponse
from lab.diagnosis.misfit import Hypothesis, Parameters
from lab.diagnosis.outcome import SpectralPrediction
from lab.diagnosis.spectral.fit import SpectralFit
from lab.diagnosis.spectral.likelihood import explained
from lab.diagnosis.spectral.motion import survey_of
from lab.diagnosis.spectral.tones import FoundTone
from lab.diagnosis.spectral.transfer import Complex, plant_response
from lab.effects.effect import Effect
from lab.effects.survey import Survey
from lab.errors import LabError
from lab.plant import Plant
from lab.rig import Rig
from lab.twin import Twin

EVERY = 10
BLOCKS = 3
"""Of every ten lines, the last three in a row are kept out of every fit: a resonance is in both parts."""
LAGS = 20
LEVEL = 1e-3
"""Probability that white noise fails the test."""
VISIBLE = (
    "mass_change",
    "stiffness_change",
    "damping_change",
    "missing_spring",
    "attached_oscillator",
    "sensor_gain",
    "sensor_delay",
    "sensor_lag",
    "sensor_swap",
    "actuator_gain",
    "actuator_delay",
    "actuator_lag",
)
"""Causes that show in frequency responses."""


@dataclass(frozen=True, eq=False)
class ResponseLikelihood:
    """Frequency responses against the twin of a model; noise of every pair of channels at its most likely level.

    There are no nuisances.

    Attributes:
        twin: of the model.
        parameters: of the model.
        survey: of rig and data.
        frequency_hz: (n_f,).
        values: (n_f, n_outputs, n_inputs).
        spread: standard deviation of each value but for one factor per pair, likewise.
        decay: rate of the exponential window behind the responses [1/s].
        dt: sample time [s]; zero for forces that vary continuously.
    """

    twin: Twin
    parameters: Parameters
    survey: Survey
    frequency_hz: Array
    values: Complex
    spread: Array
    decay: float
    dt: float
    nuisance_mean: Array
    nuisance_width: Array

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest and highest frequency of the data [Hz]."""
        return float(self.frequency_hz[0]), float(self.frequency_hz[-1])

    def plant(self, theta: Array, causes: Sequence[Hypothesis] = ()) -> Plant:
        """The plant at parameters `theta` with causes in it."""
        return explained(self.twin.changed(*self.parameters.factors(theta)), causes, self.survey)

    def predict(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Complex:
        """H of the model, (n_f, n_outputs, n_inputs)."""
        # Under e^{-γt} on forces and readings alike every pole moves by -γ: H(s) is seen at s + γ.
        shifted = self.frequency_hz - 1j * self.decay / (2 * np.pi)
        plant = self.plant(theta, causes)
        return plant_response(plant, np.asarray(shifted, dtype=np.complex128), dt=self.dt)[
            :, :, : len(plant.inputs)
        ]

    def nuisance_slopes(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Complex:
        """None."""
        return np.zeros((0, *self.values.shape), dtype=complex)

    def deviance(self, predicted: Complex) -> float:
        """2 n_f Σ log σ² over all pairs, their noise at its most likely level.

        Source: Pintelon and Schoukens (2012), System Identification, 2nd ed., section 9.2, the variance unknown.
        """
        power = self._power(predicted)
        if not np.all(np.isfinite(power)):
            return np.inf
        return float(2 * self.frequency_hz.size * np.sum(np.log(np.maximum(power, 1e-300))))

    def whitened(self, predicted: Complex, changes: Complex) -> Array:
        """Changes over their standard deviation, real and imaginary parts."""
        rows = np.sqrt(2) * changes / (self.spread * np.sqrt(self._power(predicted)))
        rows = rows.reshape(len(changes), -1)
        return np.concatenate([rows.real, rows.imag], axis=1)

    def error(self, predicted: Complex) -> Complex:
        """H of the model less H measured."""
        return np.asarray(predicted - self.values)

    def _power(self, predicted: Complex) -> Array:
        """Mean squared error of every pair in units of its spread, (n_outputs, n_inputs)."""
        return np.asarray(np.mean(np.abs(self.error(predicted) / self.spread) ** 2, axis=0))


@dataclass(frozen=True, eq=False)
class Responses:
    """Measured frequency responses.

    Attributes:
        response: the lines used.
        spread: standard deviation of each value, or what is proportional to it.
        known: whether it is the standard deviation itself.
        whole: whether fits may see all lines.
    """

    response: FrequencyResponse
    spread: Array
    known: bool
    whole: bool

    visible = VISIBLE

    @classmethod
    def of(
        cls, response: FrequencyResponse, *, band: tuple[float, float] | None, whole: bool = False
    ) -> Responses:
        """The experiment of measured responses, weighted by their variance or coherence where they have one."""
        if not response.inputs:
            raise LabError("the responses have no input; expected at least one")
        response = response.between(*band) if band is not None else response
        response = response.take(response.frequency_hz > 0)
        if response.frequency_hz.size < 2 * EVERY:
            raise LabError(
                f"there are {response.frequency_hz.size} lines; expected at least {2 * EVERY}; widen the band"
            )
        spread = np.ones(response.values.shape)
        known = response.variance is not None and bool(np.all(response.variance > 0))
        if known:
            assert response.variance is not None
            spread = np.sqrt(response.variance)
        elif response.coherence is not None:
            c = np.clip(response.coherence, 1e-6, 1 - 1e-9)[:, :, None]
            # Bendat and Piersol (2010), eq. (9.90), the number of averages in the level.
            spread = np.abs(response.values) * np.sqrt((1 - c) / c)
            spread = np.maximum(spread, 1e-6 * np.abs(response.values).max(axis=0))
        elif response.weight is not None:
            spread = spread / np.maximum(response.weight, 1e-12)[:, None, None]
        return cls(response, spread, known, whole)

    def likelihood(self, twin: Twin, parameters: Parameters, rig: Rig) -> ResponseLikelihood:
        """The likelihood of the training lines."""
        rms = np.sqrt(np.mean(np.sum(np.abs(self.response.values) ** 2, axis=2), axis=0))
        r, n = self.response, len(twin.plant.inputs)
        survey = survey_of(
            rig,
            twin,
            twin.plant,
            np.ones(n),
            dt=r.dt,
            duration=1 / np.min(np.diff(r.frequency_hz)),
            output_rms=rms,
            top_hz=None if r.dt else float(r.frequency_hz[-1]),
        )
        none = np.zeros(0)
        found = ResponseLikelihood(
            twin, parameters, survey, r.frequency_hz, r.values, self.spread, r.decay, r.dt, none, none
        )
        return _lines(found, self._training)

    def surveyed(self, likelihood: ResponseLikelihood, nuisance: Array) -> ResponseLikelihood:
        """The same: what moves the structure is known."""
        return likelihood

    def in_parts(self, likelihood: ResponseLikelihood) -> None:
        """None: averaged responses have no time."""

    def held_out(self, likelihood: ResponseLikelihood) -> ResponseLikelihood:
        """The likelihood of lines that no fit has seen."""
        r = self.response
        everything = replace(likelihood, frequency_hz=r.frequency_hz, values=r.values, spread=self.spread)
        return _lines(everything, ~self._training)

    def error(self, held_out: ResponseLikelihood, predicted: Complex) -> float:
        """RMS error over RMS response, RMS over all pairs."""
        power = np.mean(np.abs(held_out.error(predicted)) ** 2, axis=0)
        return float(np.sqrt(np.mean(power / np.mean(np.abs(held_out.values) ** 2, axis=0))))

    def floor(self, held_out: ResponseLikelihood, predicted: Complex) -> float:
        """The error that the responses' own variance makes; where it is unknown, what does not follow neighbouring lines."""
        if self.known:
            noise = np.mean(held_out.spread**2, axis=0)
        else:
            e = held_out.error(predicted)
            noise = np.mean(np.abs(np.diff(e, n=2, axis=0)) ** 2, axis=0) / 6
        return float(np.sqrt(np.mean(noise / np.mean(np.abs(held_out.values) ** 2, axis=0))))

    def left(self, likelihood: ResponseLikelihood, predicted: Complex) -> str:
        """Where the error of a response is more than noise, in a sentence; empty where it is not.

        With a known variance each line's squared error is chi-squared with two degrees of freedom; without one, noise is no
        more alike on neighbouring lines than chance (the largest of all correlations, Bonferroni).
        """
        e = likelihood.error(predicted) / likelihood.spread
        return self._too_large(e) if self.known else self._alike(e)

    def tones(
        self, likelihood: ResponseLikelihood, found: SpectralFit, effects: Mapping[str, type[Effect]]
    ) -> tuple[list[FoundTone], int]:
        """None: what is averaged has no tones left."""
        return [], 0

    def without(self, tone: FoundTone) -> Responses:
        """Not asked for, since there are no tones."""
        return self

    def again(self, likelihood: ResponseLikelihood) -> ResponseLikelihood:
        """The same."""
        return likelihood

    def shown(
        self, held_out: ResponseLikelihood, predicted: tuple[Complex, Complex, Complex]
    ) -> SpectralPrediction:
        """Magnitudes of held-out responses and of those of three models."""
        r = self.response
        measured, *models = (np.abs(H).reshape(H.shape[0], -1).T for H in (held_out.values, *predicted))
        nominal, calibrated, extended = models
        names = tuple(f"{o.name} / {i.name}" for o in r.outputs for i in r.inputs)
        units = tuple(f"({o.unit})/{i.unit}" for o in r.outputs for i in r.inputs)
        return SpectralPrediction(
            held_out.frequency_hz, measured, nominal, calibrated, extended, names, units
        )

    def warnings(self, likelihood: ResponseLikelihood, nominal: ResponseLikelihood) -> list[str]:
        """What these data cannot tell."""
        said = [
            "frequency responses are averages at one level: laws that are not linear do not show; "
            "record a test in time for them"
        ]
        if len(self.response.inputs) == 1:
            said.append(
                "with one input its gain cannot be told from a common scale of masses, stiffnesses and dampings, nor from a "
                "common gain of all sensors; calibrate the load cell, or weigh one body"
            )
        return said

    @property
    def _training(self) -> np.ndarray:
        lines = np.arange(self.response.frequency_hz.size)
        return np.ones(lines.size, bool) if self.whole else lines % EVERY < EVERY - BLOCKS

    def _too_large(self, e: Complex) -> str:
        n = e.shape[0]
        power = np.sum(2 * np.abs(e) ** 2, axis=0)
        p = scipy.stats.chi2.sf(power, 2 * n)
        i, j = np.unravel_index(np.argmax(power), power.shape)
        if p[i, j] * p.size >= LEVEL:
            return ""
        return (
            f"something is left that no cause in the catalogue explains: the error of {self._pair(int(i), int(j))} is "
            f"{np.sqrt(power[i, j] / (2 * n)):.3g} times its standard deviation"
        )

    def _alike(self, e: Complex) -> str:
        n = e.shape[0]
        flat = e.reshape(n, -1)
        flat = flat / np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
        lags = min(LAGS, n // 4)
        r = np.abs([np.sum(flat[k:] * flat[: n - k].conj(), axis=0) for k in range(1, lags + 1)]) ** 2
        # n |r|² of complex white noise is exponentially distributed.
        k, pair = np.unravel_index(np.argmax(r), r.shape)
        if np.exp(-n * r[k, pair]) * r.size >= LEVEL:
            return ""
        i, j = divmod(int(pair), e.shape[2])
        return (
            f"something is left that no cause in the catalogue explains: the error of {self._pair(int(i), int(j))} is alike on "
            f"neighbouring lines, with a correlation of {np.sqrt(r[k, pair]):.2g} over {k + 1} of them"
        )

    def _pair(self, i: int, j: int) -> str:
        return f"{self.response.outputs[i].name} by {self.response.inputs[j].name}"


def _lines(likelihood: ResponseLikelihood, use: np.ndarray) -> ResponseLikelihood:
    """The likelihood of some lines."""
    return replace(
        likelihood,
        frequency_hz=likelihood.frequency_hz[use],
        values=likelihood.values[use],
        spread=likelihood.spread[use],
    )
