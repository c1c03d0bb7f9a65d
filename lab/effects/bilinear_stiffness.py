"""A spring that is stiffer or softer in extension than in compression."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab import forces
from lab.effects.edits import law_of
from lab.effects.effect import AtStiffness, Effect
from lab.effects.one_sided import one_sided
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class BilinearStiffness(AtStiffness, Effect):
    """A spring has stiffness k (1 + r) where its extension is positive, k where it is negative.

    Attributes:
        relative_change_in_extension: r.
    """

    cause: ClassVar[str] = "bilinear_stiffness"
    units: ClassVar[dict[str, str]] = {"relative_change_in_extension": "1"}
    relative_change_in_extension: float

    def hide(self, rig: Rig) -> Rig:
        spring = rig.spring(self.location)
        k = law_of(rig, spring)[0][0]
        return one_sided(
            rig, spring, f"bilinear@{spring.name}", k * self.relative_change_in_extension, 0.0, 1
        )

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        change = plant.spring_stiffness[survey.spring(self.location)] * self.relative_change_in_extension
        return plant.with_law(forces.BILINEAR, survey.row(self.location), change)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        name = "relative_change_in_extension"
        return [Guess({name: 0.0}, {name: 1.0})]
