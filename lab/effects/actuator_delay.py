"""An actuator that pushes late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab.effects.effect import AtInput, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig
from lab.stages import Delay


@dataclass(frozen=True)
class ActuatorDelay(AtInput, Effect):
    """An input channel pushes later than recorded.

    Attributes:
        delay: [s].
    """

    cause: ClassVar[str] = "actuator_delay"
    units: ClassVar[dict[str, str]] = {"delay": "s"}
    positive: ClassVar[tuple[str, ...]] = ("delay",)
    delay: float

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("delay")
        return self.with_stage(rig, Delay(self.location, self.delay))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        i = survey.input(self.location)
        return plant.with_input(i, delay=plant.input_paths[i].delay + self.delay)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        return [Guess({"delay": share * survey.dt}, {"delay": survey.dt}) for share in (0.5, 1.5, 2.5, 4.0)]
