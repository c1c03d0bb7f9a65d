"""A structure as the cases know it: masses, springs, shakers and sensors, its matrices written down without the lab."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DERIVATIVE = {"displacement": 0, "velocity": 1, "acceleration": 2}
TOLERANCES = {"mass": 0.003, "stiffness": 0.01, "damping": 0.15}
"""Standard deviation of the logarithm of what is built over what is printed."""


@dataclass(frozen=True)
class Body:
    """A point mass [kg] with the numbers of its degrees of freedom."""

    name: str
    mass: float
    dofs: tuple[int, ...]


@dataclass(frozen=True)
class Spring:
    """A spring with a damper.

    Attributes:
        name: of the joint or tendon.
        stiffness: [N/m].
        damping: [N s/m].
        row: extension per displacement: pairs of degree of freedom and coefficient.
        joint: whether the MJCF writes it as the law of a joint.
    """

    name: str
    stiffness: float
    damping: float
    row: tuple[tuple[int, float], ...]
    joint: bool = False


@dataclass(frozen=True)
class Port:
    """A channel: its name, its degree of freedom, and what it measures ("force" for an input)."""

    name: str
    dof: int
    quantity: str = "force"


@dataclass(frozen=True)
class Structure:
    """Masses, springs, shakers and sensors.

    Attributes:
        bodies: all with the same number of degrees of freedom.
        springs: between them, and to the ground.
        inputs: shakers.
        outputs: sensors.
        dofs: names of the joints.
        untied: pairs of bodies without a spring between them, and their rows, as places of a missing spring.
    """

    bodies: tuple[Body, ...]
    springs: tuple[Spring, ...]
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    dofs: tuple[str, ...]
    untied: tuple[str, ...]

    @property
    def xml(self) -> str:
        """MJCF."""
        raise NotImplementedError

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.dofs)

    def row(self, spring: Spring) -> Array:
        """Extension per displacement, (n,)."""
        row = np.zeros(self.n)
        for dof, coefficient in spring.row:
            row[dof] += coefficient
        return row

    @property
    def matrices(self) -> tuple[Array, Array, Array]:
        """M, C, K."""
        M, C, K = np.zeros((3, self.n, self.n))
        for body in self.bodies:
            M[list(body.dofs), list(body.dofs)] = body.mass
        for spring in self.springs:
            e = self.row(spring)
            C += spring.damping * np.outer(e, e)
            K += spring.stiffness * np.outer(e, e)
        return M, C, K

    @property
    def frequencies_hz(self) -> Array:
        """Natural frequencies, lowest first."""
        M, _, K = self.matrices
        root = np.diag(1 / np.sqrt(np.diag(M)))
        return np.asarray(np.sqrt(np.linalg.eigvalsh(root @ K @ root)) / (2 * np.pi))

    @property
    def parameters(self) -> list[tuple[str, int]]:
        """Kind and number of every mass, stiffness and damping."""
        names = [("mass", i) for i in range(len(self.bodies))]
        return names + [(kind, i) for kind in ("stiffness", "damping") for i in range(len(self.springs))]

    def scaled(self, kind: str, number: int, factor: float) -> Structure:
        """The structure with one of its parameters multiplied by a factor."""
        if kind == "mass":
            bodies = list(self.bodies)
            bodies[number] = replace(bodies[number], mass=bodies[number].mass * factor)
            return replace(self, bodies=tuple(bodies))
        springs = list(self.springs)
        old = springs[number]
        springs[number] = (
            replace(old, stiffness=old.stiffness * factor)
            if kind == "stiffness"
            else replace(old, damping=old.damping * factor)
        )
        return replace(self, springs=tuple(springs))

    def jittered(self, rng: np.random.Generator) -> Structure:
        """What was really built: printed values within their tolerances."""
        built = self
        for kind, number in self.parameters:
            built = built.scaled(kind, number, float(np.exp(TOLERANCES[kind] * rng.standard_normal())))
        return built
