"""A sensor with another sensitivity than its calibration says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab.effects.effect import AtOutput, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig
from lab.stages import Gain


@dataclass(frozen=True)
class SensorGain(AtOutput, Effect):
    """An output channel reads 1 + r times the true signal.

    Attributes:
        relative_change: r; -2 is a flipped sign.
    """

    cause: ClassVar[str] = "sensor_gain"
    units: ClassVar[dict[str, str]] = {"relative_change": "1"}
    relative_change: float

    def hide(self, rig: Rig) -> Rig:
        return self.with_stage(rig, Gain(self.location, self.relative_change))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        i = survey.output(self.location)
        return plant.with_output(i, gain=plant.output_paths[i].gain * (1 + self.relative_change))

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        return [Guess({"relative_change": 0.0}, {"relative_change": 1.0})]
