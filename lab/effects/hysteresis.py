"""A spring with a memory: friction inside, as in wire ropes, bolted joints and isolators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab import forces, laws
from lab.effects.effect import AtSpring, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class Hysteresis(AtSpring, Effect):
    """A spring has a Bouc-Wen force z more: ż = A v - (|v| z + v |z|) A / (2 A x_y), exponent 1.

    Attributes:
        stiffness: A, its initial stiffness [N/m].
        yield_displacement: x_y; the force levels off at A x_y [m].

    Source: Bouc (1967), Proc. 4th Conf. Nonlinear Oscillation; Wen (1976), J. Eng. Mech. 102(2), with β = γ = 1 / (2 x_y).
    """

    cause: ClassVar[str] = "hysteresis"
    units: ClassVar[dict[str, str]] = {"stiffness": "N/m", "yield_displacement": "m"}
    positive: ClassVar[tuple[str, ...]] = ("stiffness", "yield_displacement")
    stiffness: float
    yield_displacement: float

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("stiffness", "yield_displacement")
        return laws.with_hysteresis(rig, rig.spring(self.location), self.stiffness, self.yield_displacement)

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        law = self.stiffness, self.yield_displacement
        return plant.with_law(forces.BOUC_WEN, survey.row(self.location), *law)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        row = survey.row(location)
        travel, stiff = survey.travel(row), survey.push(row) / survey.travel(row)
        scale = {"stiffness": stiff, "yield_displacement": travel}
        starts = ((0.1, 0.7), (0.15, 0.3))
        return [Guess({"stiffness": a * stiff, "yield_displacement": b * travel}, scale) for a, b in starts]
