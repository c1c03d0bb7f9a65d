"""A spring that hardens or softens with the cube of its extension."""

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
class CubicStiffness(AtSpring, Effect):
    """A spring has a force k3 x³ more, x its extension.

    Attributes:
        k3: [N/m^3]; positive hardens.
    """

    cause: ClassVar[str] = "cubic_stiffness"
    units: ClassVar[dict[str, str]] = {"k3": "N/m^3"}
    k3: float

    def hide(self, rig: Rig) -> Rig:
        k, k2, k3 = law_of(rig, rig.spring(self.location))[0]
        return with_law(rig, self.location, stiffness=[k, k2, k3 + self.k3])

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        return plant.with_law(forces.CUBIC, survey.row(self.location), self.k3, 0.0)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        row = survey.row(location)
        return [Guess({"k3": 0.0}, {"k3": survey.push(row) / survey.travel(row) ** 3})]
