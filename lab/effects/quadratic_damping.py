"""A damper whose force grows with the square of its speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab import forces
from lab.effects.edits import law_of, with_law
from lab.effects.effect import AtSpring, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class QuadraticDamping(AtSpring, Effect):
    """A spring has a damping force c2 |v| v more, v the rate of its extension, as drag has.

    Attributes:
        c2: [N s^2/m^2].
    """

    cause: ClassVar[str] = "quadratic_damping"
    units: ClassVar[dict[str, str]] = {"c2": "N s^2/m^2"}
    passive: ClassVar[tuple[str, ...]] = ("c2",)
    c2: float

    def hide(self, rig: Rig) -> Rig:
        c, c2, c3 = law_of(rig, rig.spring(self.location))[1]
        return with_law(rig, self.location, damping=[c, c2 + self.c2, c3])

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        return plant.with_law(forces.QUADRATIC, survey.row(self.location), self.c2, 0.0)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        row = survey.row(location)
        return [Guess({"c2": 0.0}, {"c2": survey.push(row) / survey.speed(row) ** 2})]
