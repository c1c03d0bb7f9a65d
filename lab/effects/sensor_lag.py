"""A sensor that follows slowly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from lab.effects.effect import AtOutput, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig
from lab.stages import BandLimitedLag, Lag


@dataclass(frozen=True)
class SensorLag(AtOutput, Effect):
    """An output channel follows through a first-order low-pass.

    Attributes:
        corner_hz: corner frequency [Hz].
        band_limited: whether the channel's signal is limited to half the sample rate before it lags.
    """

    cause: ClassVar[str] = "sensor_lag"
    units: ClassVar[dict[str, str]] = {"corner_hz": "Hz"}
    positive: ClassVar[tuple[str, ...]] = ("corner_hz",)
    corner_hz: float
    band_limited: bool = False

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("corner_hz")
        if not self.band_limited:
            return self.with_stage(rig, Lag(self.location, self.corner_hz))
        return self.with_samples_through(rig, BandLimitedLag(self.location, self.corner_hz))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        i = survey.output(self.location)
        tau = 1 / (2 * math.pi * self.corner_hz)
        return plant.with_output(i, **{"band_limited_lag" if self.band_limited else "lag": tau})

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        corner = 0.4 / survey.dt
        start, scale = {"corner_hz": corner}, {"corner_hz": corner}
        return [Guess(start, scale, {"band_limited": limited}) for limited in (False, True)]
