"""Responses: measured frequency responses, as an experiment in the frequency domain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.special

from identification.recording import Array
from identification.response import FrequencyResponse
from lab.diagnosis.outcome import SpectralPrediction
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.spectral.fit import SpectralFit
from lab.diagnosis.spectral.lesson import Lesson, lesson_of
from lab.diagnosis.spectral.motion import survey_of
from lab.diagnosis.spectral.response_likelihood import ResponseLikelihood
from lab.diagnosis.spectral.scale import Scale
from lab.diagnosis.spectral.spread import noise_floors, spread_of
from lab.diagnosis.spectral.tones import FoundTone
from lab.diagnosis.spectral.transfer import Complex
from lab.effects.effect import Effect
from lab.errors import LabError
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
HIDDEN: dict[str, tuple[str, ...]] = {
    "known": (),
    "unknown per input": ("actuator_gain",),
    "unknown per response": ("actuator_gain", "sensor_gain"),
}
"""Those of them that an unknown scale hides."""
SCALE_UNKNOWN = (
    "the scale of the responses is unknown: all masses, stiffnesses and dampings together are known only as well as before; "
    "calibrate the measuring chain, or weigh one body"
)


@dataclass(frozen=True, eq=False)
class Responses:
    """Measured frequency responses.

    Attributes:
        response: the lines used.
        spread: standard deviation of each value, or what is proportional to it.
        stated: whether the data say what it is proportional to.
        known: whether it is the standard deviation itself.
        whole: whether fits may see all lines.
        floors: size of each response up to which errors are even, (n_outputs, n_inputs); infinite where they are all along.
        lesson: how the model errs where nothing is wrong; None where no baseline told.
    """

    response: FrequencyResponse
    spread: Array
    stated: bool
    known: bool
    whole: bool
    floors: Array
    lesson: Lesson | None = None

    @property
    def visible(self) -> tuple[str, ...]:
        """Causes that show in the responses: no gain that their unknown scale takes up."""
        hidden = HIDDEN[self.response.scale]
        return tuple(cause for cause in VISIBLE if cause not in hidden)

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
        stated = known or response.coherence is not None or response.weight is not None
        return cls(response, spread, stated, known, whole, np.full(spread.shape[1:], np.inf))

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
        scale = Scale.of(r.scale, len(r.outputs), n)
        found = ResponseLikelihood(
            twin, parameters, survey, r.frequency_hz, r.values, self.spread, r.decay, r.dt, scale
        )
        found = _lines(found, self._training)
        H = found.unscaled(np.zeros(parameters.n), ())
        found = replace(found, scale=scale.estimated(H, found.values))
        return found if self.lesson is None else self.lesson.heeded(found)

    def weighted(self, likelihood: ResponseLikelihood, predicted: Complex) -> Responses:
        """The responses with errors spread over their lines as a fit leaves them, where the data do not say how."""
        if self.stated:
            return self
        floors = noise_floors(likelihood.values, likelihood.error(predicted))
        return replace(self, spread=spread_of(self.response.values, floors), floors=floors)

    def lesson_of(self, likelihood: ResponseLikelihood, predicted: Complex) -> Lesson:
        """How the model errs in these responses."""
        return lesson_of(likelihood, predicted, self.floors)

    def after(self, lesson: Lesson | None) -> Responses:
        """The responses seen by one who knows how the model errs where nothing is wrong."""
        if lesson is None or self.stated:
            return replace(self, lesson=lesson)
        return replace(
            self, lesson=lesson, spread=spread_of(self.response.values, lesson.floors), stated=True
        )

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

        After a baseline it may be as large as there. With a known variance each line's squared error is chi-squared with two
        degrees of freedom; without one, noise is no more alike on neighbouring lines than chance (the largest of all
        correlations, Bonferroni).
        """
        if self.lesson is not None:
            return self._beyond(self.lesson.excess(likelihood, predicted))
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
        """The same likelihood with errors spread as they are now."""
        return replace(likelihood, spread=self.spread[self._training])

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
        said = [SCALE_UNKNOWN] if self.response.scale != "known" else []
        said += [
            "frequency responses are averages at one level: laws that are not linear do not show; "
            "record a test in time for them"
        ]
        if self.response.scale == "known" and len(self.response.inputs) == 1:
            said.append(
                "with one input its gain cannot be told from a common scale of masses, stiffnesses and dampings, nor from a "
                "common gain of all sensors; calibrate the load cell, or weigh one body"
            )
        return said

    @property
    def _training(self) -> np.ndarray:
        lines = np.arange(self.response.frequency_hz.size)
        return np.ones(lines.size, bool) if self.whole else lines % EVERY < EVERY - BLOCKS

    def _beyond(self, excess: tuple[float, tuple[int, int]] | None) -> str:
        if excess is None:
            return ""
        return (
            f"something is left that no cause in the catalogue explains: the error of {self._pair(*excess[1])} is "
            f"{excess[0]:.3g} times that of the model in the baseline"
        )

    def _too_large(self, e: Complex) -> str:
        n = e.shape[0]
        power = np.sum(2 * np.abs(e) ** 2, axis=0)
        p = scipy.special.chdtrc(2 * n, power)
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
