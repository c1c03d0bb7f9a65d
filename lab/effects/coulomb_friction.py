"""Dry friction: a guide or a bearing that sticks and slips."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import ClassVar

from lab import forces
from lab.effects.edits import joint_element, spring_element
from lab.effects.effect import Effect
from lab.effects.survey import Guess, Survey
from lab.mjcf import number
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """A joint or tendon resists motion with a constant force.

    Attributes:
        force: [N].
    """

    cause: ClassVar[str] = "coulomb_friction"
    units: ClassVar[dict[str, str]] = {"force": "N"}
    positive: ClassVar[tuple[str, ...]] = ("force",)
    force: float

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("force")
        self.require(self.location, self.places(rig), "joint or tendon")
        m = rig.model
        if self.location in rig.dofs:
            present = float(m.dof_frictionloss[rig.dofs.index(self.location)])
        else:
            present = float(m.tendon_frictionloss[rig.spring(self.location).index])

        def edit(root: ET.Element) -> None:
            if self.location in rig.dofs:
                element = joint_element(root, self.location)
            else:
                element = spring_element(root, rig.spring(self.location))
            element.set("frictionloss", number(present + self.force))

        return rig.edited(edit)

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        return plant.with_law(forces.COULOMB, survey.row(self.location), self.force, 0.0)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        push = survey.push(survey.row(location))
        return [Guess({"force": share * push}, {"force": push}) for share in (0.02, 0.1)]

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every joint, and every tendon that is a spring."""
        return (*rig.dofs, *(spring.name for spring in rig.springs if spring.kind == "tendon"))
