"""Mains hum in one channel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from lab.effects.effect import AtOutput, Effect
from lab.effects.survey import Guess, Survey
from lab.plant import Plant
from lab.rig import Rig
from lab.stages import Hum


@dataclass(frozen=True)
class LineHum(AtOutput, Effect):
    """An output channel has a sine added that is no motion.

    Attributes:
        frequency_hz: [Hz].
        amplitude: [unit of the channel].
        phase: at the start of the record [rad].
    """

    cause: ClassVar[str] = "line_hum"
    units: ClassVar[dict[str, str]] = {
        "frequency_hz": "Hz",
        "amplitude": "unit of the channel",
        "phase": "rad",
    }
    frequency_hz: float
    amplitude: float
    phase: float = 0.0

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("frequency_hz")
        return self.with_stage(rig, Hum(self.location, self.frequency_hz, self.amplitude, self.phase))

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        i = survey.output(self.location)
        tone = self.frequency_hz, self.amplitude * math.cos(self.phase), self.amplitude * math.sin(self.phase)
        return plant.with_output(i, hum=(*plant.output_paths[i].hum, tone))

    @classmethod
    def of(cls, location: str, values: Mapping[str, Any]) -> Effect:
        rest = dict(values)
        sine, cosine = rest.pop("sine"), rest.pop("cosine")
        return cls(location, amplitude=math.hypot(sine, cosine), phase=math.atan2(cosine, sine), **rest)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        i = survey.output(location)
        scale = {
            "frequency_hz": 1 / survey.duration,
            "sine": survey.output_rms[i],
            "cosine": survey.output_rms[i],
        }
        start = {"sine": 0.0, "cosine": 0.0}
        return [Guess({"frequency_hz": frequency, **start}, scale) for frequency in survey.tones[i]]
