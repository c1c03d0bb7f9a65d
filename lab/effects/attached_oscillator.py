"""Something loose on a body that resonates: a cable, a cover, a forgotten tool."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from math import pi
from typing import ClassVar

import mujoco
import numpy as np

from identification.recording import Array
from lab.effects.edits import body_element, body_number, numbers
from lab.effects.effect import AtBody, Effect
from lab.effects.survey import Guess, Survey
from lab.errors import LabError
from lab.mjcf import number
from lab.plant import Plant
from lab.rig import Rig


@dataclass(frozen=True)
class AttachedOscillator(AtBody, Effect):
    """A body carries a small mass on a spring and a damper that the model does not have.

    The mass moves along the body's own slide; on a body with several slides, along each of them alike.

    Attributes:
        mass: of the oscillator [kg].
        frequency_hz: its natural frequency on a body held still [Hz].
        damping_ratio: likewise [1].
    """

    cause: ClassVar[str] = "attached_oscillator"
    units: ClassVar[dict[str, str]] = {"mass": "kg", "frequency_hz": "Hz", "damping_ratio": "1"}
    positive: ClassVar[tuple[str, ...]] = ("mass", "frequency_hz", "damping_ratio")
    grows: ClassVar[bool] = True
    mass: float
    frequency_hz: float
    damping_ratio: float = 0.0

    def hide(self, rig: Rig) -> Rig:
        self.require_positive("mass", "frequency_hz")
        self.require(self.location, rig.bodies, "body")
        m, body = rig.model, body_number(rig, self.location)
        joints = range(m.body_jntadr[body], m.body_jntadr[body] + m.body_jntnum[body])
        slides = [j for j in joints if m.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_SLIDE)]
        if not slides:
            raise LabError(
                f"attached_oscillator at {self.location!r}: the body has no slide joint to move along"
            )
        omega = 2 * pi * self.frequency_hz
        stiffness, damping = self.mass * omega**2, 2 * self.damping_ratio * self.mass * omega

        def edit(root: ET.Element) -> None:
            name = f"oscillator@{self.location}"
            child = ET.SubElement(body_element(root, self.location), "body", name=name)
            for j in slides:
                ET.SubElement(
                    child,
                    "joint",
                    name=f"{name}.{rig.dofs[j]}",
                    type="slide",
                    axis=numbers(m.jnt_axis[j]),
                    stiffness=number(stiffness),
                    damping=number(damping),
                )
            # Only its mass counts: it does not turn by itself.
            inertia = numbers([1e-3 * self.mass] * 3)
            ET.SubElement(child, "inertial", pos="0 0 0", mass=number(self.mass), diaginertia=inertia)

        return rig.edited(edit)

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        body = survey.body(self.location)
        return with_oscillator(plant, survey.twin.masses[body], survey.twin.body_mass[body], self)

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        mass, middle = survey.twin.body_mass[survey.body(location)], survey.middle_frequency
        scale = {"mass": mass, "frequency_hz": middle, "damping_ratio": 0.1}
        return [
            Guess({"mass": 0.04 * mass, "frequency_hz": ratio * middle, "damping_ratio": 0.03}, scale)
            for ratio in (0.45, 0.6, 0.75, 0.9, 1.1, 1.3, 1.6)
        ]


def with_oscillator(plant: Plant, body: Array, body_mass: float, oscillator: AttachedOscillator) -> Plant:
    """The plant with one more degree of freedom for every direction in which the body's mass moves."""
    # Directions of the body: the part of M that it brings, per kilogram, is a sum of their outer products.
    weights, directions = np.linalg.eigh(body / body_mass)
    n = plant.n_dofs
    # Other oscillators may be there already.
    directions = _padded(directions[:, weights > 0.5], n - len(body), 0)
    extra = directions.shape[1]
    omega = 2 * pi * oscillator.frequency_hz
    relative = np.vstack([-directions, np.eye(extra)])  # extension of each oscillator's spring
    tie = relative @ relative.T
    inertia = np.zeros((n + extra, n + extra))
    inertia[n:, n:] = oscillator.mass * np.eye(extra)
    damping = 2 * oscillator.damping_ratio * oscillator.mass * omega * tie
    return replace(
        plant,
        mass=_padded(plant.mass, extra, extra) + inertia,
        damping=_padded(plant.damping, extra, extra) + damping,
        stiffness=_padded(plant.stiffness, extra, extra) + oscillator.mass * omega**2 * tie,
        forces=_padded(plant.forces, extra, 0),
        displacement=_padded(plant.displacement, 0, extra),
        velocity=_padded(plant.velocity, 0, extra),
        acceleration=_padded(plant.acceleration, 0, extra),
        laws=tuple(replace(law, row=np.concatenate([law.row, np.zeros(extra)])) for law in plant.laws),
        tones=tuple(replace(tone, row=np.concatenate([tone.row, np.zeros(extra)])) for tone in plant.tones),
    )


def _padded(matrix: Array, rows: int, columns: int) -> Array:
    """The matrix with so many rows and columns of zeros behind."""
    padded = np.zeros((matrix.shape[0] + rows, matrix.shape[1] + columns))
    padded[: matrix.shape[0], : matrix.shape[1]] = matrix
    return padded
