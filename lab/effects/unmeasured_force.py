"""A force that nobody measured: a pump next door, traffic, wind."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from lab.effects.edits import body_number
from lab.effects.effect import AtBody, Effect
from lab.effects.survey import Guess, Survey
from lab.errors import LabError
from lab.plant import Plant, Tone
from lab.rig import Rig
from lab.stages import Hum, Noise


@dataclass(frozen=True)
class UnmeasuredForce(AtBody, Effect):
    """A body is pushed by a force that no input channel knows: a sine, or white noise.

    Attributes:
        frequency_hz: of the sine [Hz]; None for noise.
        amplitude: of the sine [N]; None for noise.
        phase: of the sine at the start of the record [rad].
        rms: of the noise [N], held over each sample; None for a sine.
        dof: joint of the body along which it acts; the first one when None.
    """

    cause: ClassVar[str] = "unmeasured_force"
    units: ClassVar[dict[str, str]] = {"frequency_hz": "Hz", "amplitude": "N", "phase": "rad", "rms": "N"}
    frequency_hz: float | None = None
    amplitude: float | None = None
    phase: float = 0.0
    rms: float | None = None
    dof: str | None = None

    def hide(self, rig: Rig) -> Rig:
        self.require(self.location, rig.bodies, "body")
        joints = self._at(rig, self.location)
        dof = joints[0] if self.dof is None and joints else self.dof
        self.require(str(dof), joints, "joint of the body called")
        if self.rms is not None and self.frequency_hz is None and self.amplitude is None:
            stage: Hum | Noise = Noise(str(dof), std=self.rms)
        elif self.rms is None and self.frequency_hz is not None and self.amplitude is not None:
            stage = Hum(str(dof), self.frequency_hz, self.amplitude, self.phase)
        else:
            raise LabError(
                f"unmeasured_force at {self.location!r} has parameters {self.parameters}; expected frequency_hz and "
                "amplitude, or rms"
            )
        return rig.with_chain(rig.chain.adding("disturbances", stage))

    @staticmethod
    def _at(rig: Rig, location: str) -> tuple[str, ...]:
        """Joints of a body."""
        m, body = rig.model, body_number(rig, location)
        return rig.dofs[m.body_jntadr[body] : m.body_jntadr[body] + m.body_jntnum[body]]

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        dof = self.dof or self._at(survey.rig, self.location)[0]
        tone = Tone(
            survey.row(dof),
            float(self.frequency_hz or 0.0),
            float(self.amplitude or 0.0) * math.cos(self.phase),
            float(self.amplitude or 0.0) * math.sin(self.phase),
        )
        return replace(plant, tones=(*plant.tones, tone))

    @classmethod
    def of(cls, location: str, values: Mapping[str, Any]) -> Effect:
        rest = dict(values)
        sine, cosine = rest.pop("sine"), rest.pop("cosine")
        return cls(location, amplitude=math.hypot(sine, cosine), phase=math.atan2(cosine, sine), **rest)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        found = []
        own = [
            f
            for i, c in enumerate(survey.rig.outputs)
            if c.dof in cls._at(survey.rig, location)
            for f in survey.tones[i]
        ]
        for dof in cls._at(survey.rig, location):
            push = survey.push(survey.row(dof))
            scale = {"frequency_hz": 1 / survey.duration, "sine": push, "cosine": push}
            for frequency in dict.fromkeys((*survey.common_tones, *own)):
                start = {"frequency_hz": frequency, "sine": 0.0, "cosine": 0.0}
                found.append(Guess(start, scale, {"dof": dof}))
        return found
