"""A spring stiffer or softer than the model says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from lab.effects.edits import law_of, with_law
from lab.effects.effect import EVERYWHERE, AtStiffness, Effect
from lab.effects.survey import Survey
from lab.errors import LabError
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class StiffnessChange(AtStiffness, Effect):
    """A spring has another stiffness than the model says.

    Attributes:
        relative_change: true over nominal stiffness, less one; of one spring, or of all at the location "*".
    """

    cause: ClassVar[str] = "stiffness_change"
    units: ClassVar[dict[str, str]] = {"relative_change": "1"}
    relative_change: float

    def hide(self, rig: Rig) -> Rig:
        if self.relative_change < -1:
            raise LabError(
                f"stiffness_change at {self.location!r}: relative_change is {self.relative_change}; expected -1 or more; -1 "
                "leaves nothing"
            )
        names = self.places(rig) if self.location == EVERYWHERE else (self.location,)
        for name in names:
            law = law_of(rig, rig.spring(name))[0]
            rig = with_law(rig, name, stiffness=[(1 + self.relative_change) * x for x in law])
        return rig

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        rows = survey.twin.rows
        which = slice(None) if self.location == EVERYWHERE else [survey.spring(self.location)]
        change = self.relative_change * plant.spring_stiffness[which]
        return replace(plant, stiffness=plant.stiffness + rows[which].T @ (change[:, None] * rows[which]))
