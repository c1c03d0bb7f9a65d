"""A sensor driven over its range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab.effects.effect import AtOutput, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig
from lab.stages import Saturation


@dataclass(frozen=True)
class SensorSaturation(AtOutput, Effect):
    """An output channel clips at a limit either way.

    Attributes:
        limit: [unit of the channel].
    """

    cause: ClassVar[str] = "sensor_saturation"
    units: ClassVar[dict[str, str]] = {"limit": "unit of the channel"}
    positive: ClassVar[tuple[str, ...]] = ("limit",)
    limit: float

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("limit")
        return self.with_stage(rig, Saturation(self.location, self.limit))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        i = survey.output(self.location)
        return plant.with_output(i, limit=min(plant.output_paths[i].limit, self.limit))

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        peak, rms = survey.output_peak[survey.output(location)], survey.output_rms[survey.output(location)]
        return [Guess({"limit": limit}, {"limit": rms}) for limit in (0.97 * peak, 1.5 * rms)]
