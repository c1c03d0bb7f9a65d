"""A spring that changes during the test: temperature, relaxation, fatigue."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab import forces, laws
from lab.effects.edits import law_of
from lab.effects.effect import AtStiffness, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class StiffnessDrift(AtStiffness, Effect):
    """A spring's stiffness changes linearly from k at the start of a record to k (1 + r) at its end.

    Attributes:
        relative_change_over_record: r.
    """

    cause: ClassVar[str] = "stiffness_drift"
    units: ClassVar[dict[str, str]] = {"relative_change_over_record": "1"}
    relative_change_over_record: float

    def hide(self, rig: Rig) -> Rig:
        spring = rig.spring(self.location)
        k = law_of(rig, spring)[0][0]
        return laws.with_drift(rig, spring, k * self.relative_change_over_record)

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        change = plant.spring_stiffness[survey.spring(self.location)] * self.relative_change_over_record
        return plant.with_law(forces.DRIFT, survey.row(self.location), change)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        name = "relative_change_over_record"
        return [Guess({name: 0.0}, {name: 1.0})]
