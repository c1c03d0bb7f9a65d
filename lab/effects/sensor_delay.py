"""A channel that arrives late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab.chain import Delay
from lab.effects.effect import AtOutput, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class SensorDelay(AtOutput, Effect):
    """An output channel arrives later than the others.

    Attributes:
        delay: [s].
    """

    cause: ClassVar[str] = "sensor_delay"
    units: ClassVar[dict[str, str]] = {"delay": "s"}
    positive: ClassVar[tuple[str, ...]] = ("delay",)
    delay: float

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("delay")
        return self.with_stage(rig, Delay(self.location, self.delay))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        i = survey.output(self.location)
        return plant.with_output(i, delay=plant.output_paths[i].delay + self.delay)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        return [Guess({"delay": share * survey.dt}, {"delay": survey.dt}) for share in (0.5, 1.5, 2.5, 4.0)]
