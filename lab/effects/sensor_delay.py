"""A channel that arrives late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lab.effects.effect import AtOutput, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig
from lab.stages import BandLimitedDelay, Delay


@dataclass(frozen=True)
class SensorDelay(AtOutput, Effect):
    """An output channel arrives later than the others.

    Attributes:
        delay: [s].
        band_limited: whether the channel's signal is limited to half the sample rate before it is late.
    """

    cause: ClassVar[str] = "sensor_delay"
    units: ClassVar[dict[str, str]] = {"delay": "s"}
    positive: ClassVar[tuple[str, ...]] = ("delay",)
    delay: float
    band_limited: bool = False

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("delay")
        if self.band_limited:
            return self.with_samples_through(rig, BandLimitedDelay(self.location, self.delay))
        return self.with_stage(rig, Delay(self.location, self.delay))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        i = survey.output(self.location)
        path = plant.output_paths[i]
        if self.band_limited:
            return plant.with_output(i, band_limited_delay=path.band_limited_delay + self.delay)
        return plant.with_output(i, delay=path.delay + self.delay)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        return [
            Guess({"delay": share * survey.dt}, {"delay": survey.dt}, {"band_limited": limited})
            for limited, shares in ((False, (0.5, 1.5, 2.5, 4.0)), (True, (0.5, 2.0, 4.0)))
            for share in shares
        ]
