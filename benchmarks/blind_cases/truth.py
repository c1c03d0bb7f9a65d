"""What was hidden in a case, and the case itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from benchmarks.blind_cases.structure import DERIVATIVE, Array, Port, Spring, Structure
from identification.recording import Recording
from lab.effects import EFFECTS
from lab.effects.effect import Effect


@dataclass(frozen=True)
class Hidden:
    """One cause that was hidden.

    Attributes:
        cause: its name in the catalogue, of the nearest law there, or of a law that the catalogue does not have.
        location: where.
        parameters: true values; empty where only the name counts.
        also: places that are the same by their physics, as a joint and the one tendon that reads it.
        exact: whether the law is the catalogue's own.
    """

    cause: str
    location: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    also: tuple[str, ...] = ()
    exact: bool = True

    @property
    def outside(self) -> bool:
        """Whether the catalogue has neither the law nor one near it."""
        return self.cause not in EFFECTS

    def effect(self) -> Effect:
        """As the lab hides it."""
        return EFFECTS[self.cause](self.location, **self.parameters)


@dataclass(frozen=True, eq=False)
class Case:
    """Data with something hidden in them.

    Attributes:
        family, seed: what it was drawn from.
        xml: MJCF of what the engineer believes.
        recording: what was measured.
        hidden: the answer.
        jitter: whether the structure was built within tolerances only.
        deflection: of the best test that knows everything but the size, in standard deviations; nan where not worked out.
    """

    family: str
    seed: int
    xml: str
    recording: Recording
    hidden: tuple[Hidden, ...]
    jitter: bool
    deflection: float

    def __repr__(self) -> str:
        names = ", ".join(f"{h.cause}@{h.location}" for h in self.hidden) or "nothing"
        return f"Case({self.family} {self.seed}: {names}, {self.deflection:.3g} standard deviations)"


@dataclass(frozen=True, eq=False)
class Scale:
    """How strongly a test moves a structure, for sizes that matter.

    Attributes:
        structure: as built.
        inputs: (n_inputs, n_samples) [N].
        dt: sample time [s].
        motion: displacement, velocity, acceleration, (3, n, n_samples).
    """

    structure: Structure
    inputs: Array
    dt: float
    motion: Array

    def extension(self, spring: Spring) -> tuple[float, float]:
        """RMS extension [m] and rate [m/s] of a spring."""
        row = self.structure.row(spring)
        return float(np.std(row @ self.motion[0])), float(np.std(row @ self.motion[1]))

    def rms(self, port: Port) -> float:
        """RMS of an output."""
        return float(np.std(self.motion[DERIVATIVE[port.quantity], port.dof]))

    @property
    def push(self) -> float:
        """RMS force of all shakers [N]."""
        return float(np.sqrt(np.sum(np.mean(self.inputs**2, axis=1))))
