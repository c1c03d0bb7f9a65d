"""An actuator that follows slowly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from lab.effects.effect import AtInput, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig
from lab.stages import HeldLag, Lag


@dataclass(frozen=True)
class ActuatorLag(AtInput, Effect):
    """An input channel follows the recorded force through a first-order lag.

    Attributes:
        time_constant: [s].
        held: whether the lagging force is held over each sample, as a digital controller does, or follows smoothly.
    """

    cause: ClassVar[str] = "actuator_lag"
    units: ClassVar[dict[str, str]] = {"time_constant": "s"}
    positive: ClassVar[tuple[str, ...]] = ("time_constant",)
    time_constant: float
    held: bool = False

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("time_constant")
        corner = 1 / (2 * math.pi * self.time_constant)
        stage = HeldLag(self.location, self.time_constant) if self.held else Lag(self.location, corner)
        return self.with_stage(rig, stage)

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        i = survey.input(self.location)
        return (
            plant.with_input(i, held_lag=self.time_constant)
            if self.held
            else plant.with_input(i, lag=self.time_constant)
        )

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        start, scale = {"time_constant": 0.5 * survey.dt}, {"time_constant": survey.dt}
        return [Guess(start, scale, {"held": held}) for held in (True, False)]
