"""Two cables exchanged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from lab.effects.effect import Effect, pairs
from lab.effects.survey import Guess, Survey
from lab.errors import LabError
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class SensorSwap(Effect):
    """Two output channels of the same unit carry each other's signal."""

    cause: ClassVar[str] = "sensor_swap"

    def hide(self, rig: Rig) -> Rig:
        a, _, b = self.location.partition("|")
        for name in (a, b):
            self.require(name, [channel.name for channel in rig.outputs], "output channel")
        if f"{a}|{b}" not in self.places(rig) and f"{b}|{a}" not in self.places(rig):
            raise LabError(
                f"sensor_swap at {self.location!r}: expected two different channels of the same unit"
            )
        return rig.with_chain(replace(rig.chain, swaps=(*rig.chain.swaps, (a, b))))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        a, b = (survey.output(name) for name in self.location.split("|"))
        order = list(plant.order or range(len(plant.outputs)))
        order[a], order[b] = order[b], order[a]
        return replace(plant, order=tuple(order))

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        return [Guess({}, {})]

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every pair of output channels of the same unit."""
        units = {channel.name: channel.unit for channel in rig.outputs}
        every = pairs([channel.name for channel in rig.outputs])
        return tuple(pair for pair in every if len({units[name] for name in pair.split("|")}) == 1)
