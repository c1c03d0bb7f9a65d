"""A stop that a spring's ends meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab import forces
from lab.effects.effect import AtSpring, Effect
from lab.effects.one_sided import one_sided
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class GapContact(AtSpring, Effect):
    """A spring's extension meets an elastic stop.

    Attributes:
        gap: extension at touch [m]; a negative one is met in compression.
        contact_stiffness: of the stop [N/m].
    """

    cause: ClassVar[str] = "gap_contact"
    units: ClassVar[dict[str, str]] = {"gap": "m", "contact_stiffness": "N/m"}
    positive: ClassVar[tuple[str, ...]] = ("contact_stiffness",)
    gap: float
    contact_stiffness: float

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("contact_stiffness")
        spring = rig.spring(self.location)
        side = 1 if self.gap >= 0 else -1
        return one_sided(rig, spring, f"stop@{spring.name}", self.contact_stiffness, self.gap, side)

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        side = 1.0 if self.gap >= 0 else -1.0
        return plant.with_law(forces.STOP, survey.row(self.location), self.gap, self.contact_stiffness, side)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        row = survey.row(location)
        travel, stiff = survey.travel(row), survey.push(row) / survey.travel(row)
        scale = {"gap": travel, "contact_stiffness": stiff}
        starts = [(side * share, k) for side in (1, -1) for share, k in ((0.6, 0.7), (1.4, 1.0))]
        return [Guess({"gap": share * travel, "contact_stiffness": k * stiff}, scale) for share, k in starts]
