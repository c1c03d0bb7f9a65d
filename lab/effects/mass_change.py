"""A body heavier or lighter than the model says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from lab.effects.edits import body_number, with_mass
from lab.effects.effect import EVERYWHERE, AtBody, Effect
from lab.effects.survey import Survey
from lab.errors import LabError
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class MassChange(AtBody, Effect):
    """A body has another mass than the model says; its inertia grows in proportion.

    Attributes:
        delta_mass: true less nominal mass [kg]; for one body.
        relative_change: true over nominal mass, less one; for all bodies, at the location "*".
    """

    cause: ClassVar[str] = "mass_change"
    units: ClassVar[dict[str, str]] = {"delta_mass": "kg", "relative_change": "1"}
    delta_mass: float | None = None
    relative_change: float | None = None

    def hide(self, rig: Rig) -> Rig:
        if (self.relative_change is None) == (self.delta_mass is None) or (
            (self.location == EVERYWHERE) != (self.delta_mass is None)
        ):
            raise LabError(
                f"mass_change at {self.location!r} has parameters {self.parameters}; expected delta_mass for one body, "
                "relative_change for the location '*'"
            )
        if self.location == EVERYWHERE:
            for body in rig.bodies:
                rig = with_mass(rig, body, self._positive(1 + float(self.relative_change or 0.0)))
            return rig
        self.require(self.location, rig.bodies, "body")
        mass = float(rig.model.body_mass[body_number(rig, self.location)])
        return with_mass(rig, self.location, self._positive((mass + float(self.delta_mass or 0.0)) / mass))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        if self.location == EVERYWHERE:
            return replace(
                plant, mass=plant.mass + float(self.relative_change or 0.0) * survey.twin.masses.sum(axis=0)
            )
        body = survey.body(self.location)
        share = float(self.delta_mass or 0.0) / survey.twin.body_mass[body]
        return replace(plant, mass=plant.mass + share * survey.twin.masses[body])

    def _positive(self, factor: float) -> float:
        if not factor > 0:
            raise LabError(
                f"mass_change at {self.location!r} leaves {factor:.3g} of the mass; expected more than none"
            )
        return factor
