"""A spring with clearance: no force until its ends have taken up the gap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab import forces
from lab.effects.edits import copy_of, law_of, numbers, with_law, with_tendon
from lab.effects.effect import AtStiffness, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class Freeplay(AtStiffness, Effect):
    """A spring has no stiffness force while |x| is less than the gap, and k (|x| - gap) beyond; its damping stays.

    Attributes:
        half_gap: [m].
    """

    cause: ClassVar[str] = "freeplay"
    units: ClassVar[dict[str, str]] = {"half_gap": "m"}
    positive: ClassVar[tuple[str, ...]] = ("half_gap",)
    half_gap: float

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("half_gap")
        spring = rig.spring(self.location)
        law = law_of(rig, spring)[0]
        tendon = copy_of(rig, spring, f"freeplay@{spring.name}")
        tendon.set(
            "springlength", numbers([spring.reference - self.half_gap, spring.reference + self.half_gap])
        )
        tendon.set("stiffness", numbers(law))
        return with_tendon(with_law(rig, spring.name, stiffness=[0.0, 0.0, 0.0]), tendon)

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        k = plant.spring_stiffness[survey.spring(self.location)]
        return plant.with_law(forces.DEADBAND, survey.row(self.location), self.half_gap, k)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        travel = survey.travel(survey.row(location))
        return [Guess({"half_gap": share * travel}, {"half_gap": travel}) for share in (0.1, 0.3)]
