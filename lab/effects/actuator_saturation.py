"""An actuator driven over its range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab.effects.effect import AtInput, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig
from lab.stages import Saturation


@dataclass(frozen=True)
class ActuatorSaturation(AtInput, Effect):
    """An input channel pushes no harder than a limit either way.

    Attributes:
        limit: [N].
    """

    cause: ClassVar[str] = "actuator_saturation"
    units: ClassVar[dict[str, str]] = {"limit": "N"}
    positive: ClassVar[tuple[str, ...]] = ("limit",)
    limit: float

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("limit")
        return self.with_stage(rig, Saturation(self.location, self.limit))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        i = survey.input(self.location)
        return plant.with_input(i, limit=min(plant.input_paths[i].limit, self.limit))

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        peak, rms = survey.input_peak[survey.input(location)], survey.input_rms[survey.input(location)]
        # A limit that clips nothing has no slope, and one that clips all leads nowhere.
        limits = (0.97 * peak, 0.8 * peak, 0.6 * peak, 1.5 * rms)
        return [Guess({"limit": limit}, {"limit": rms}) for limit in limits]
