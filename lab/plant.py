"""Plant: what a rig does to signals, as matrices and a few local laws; its responses take milliseconds.

A plant is the fast twin of a rig: the structure linearized about its operating point with its mass, damping and stiffness
as sums over bodies and springs, plus the force laws that are not linear, plus the measurement chain. MuJoCo stays the
reference; the tests hold one against the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from identification.recording import Array, Channel
from lab.paths import Path as Path


@dataclass(frozen=True, eq=False)
class Law:
    """A restoring force between degrees of freedom that depends on their extension along `row`.

    Attributes:
        kind: one of the laws of `lab.forces`.
        row: extension per displacement of each degree of freedom, shape (n_dofs,).
        parameters: up to three numbers.
    """

    kind: int
    row: Array
    parameters: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Tone:
    """A force `sine` sin(2π f t) + `cosine` cos(2π f t) [N] along `row`, held over each sample from its start t."""

    row: Array
    frequency_hz: float
    sine: float
    cosine: float


@dataclass(frozen=True, eq=False)
class Plant:
    """Structure and chain as arrays.

    Attributes:
        mass, damping, stiffness: M, C_d, K, each (n_dofs, n_dofs).
        forces: force on each degree of freedom per unit of input, (n_dofs, n_inputs).
        displacement, velocity, acceleration: readings per unit of motion, each (n_outputs, n_dofs).
        inputs, outputs: channels.
        laws: local forces that are not linear.
        tones: forces that no input knows.
        input_paths, output_paths: one per channel.
        spring_stiffness, spring_damping: linear coefficients of the springs that `stiffness` and `damping` are made of.
        order: which output each recorded channel carries; empty where each carries its own.
    """

    mass: Array
    damping: Array
    stiffness: Array
    forces: Array
    displacement: Array
    velocity: Array
    acceleration: Array
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    input_paths: tuple[Path, ...]
    output_paths: tuple[Path, ...]
    spring_stiffness: Array
    spring_damping: Array
    laws: tuple[Law, ...] = ()
    tones: tuple[Tone, ...] = ()
    order: tuple[int, ...] = ()

    @property
    def n_dofs(self) -> int:
        """Degrees of freedom."""
        return self.mass.shape[0]

    def with_law(self, kind: int, row: Array, *parameters: float) -> Plant:
        """The plant with one more local force."""
        return replace(self, laws=(*self.laws, Law(kind, row, parameters)))

    def with_output(self, channel: int, **changes: object) -> Plant:
        """The plant with another path behind one output."""
        paths = list(self.output_paths)
        paths[channel] = replace(paths[channel], **changes)  # type: ignore[arg-type]
        return replace(self, output_paths=tuple(paths))

    def with_input(self, channel: int, **changes: object) -> Plant:
        """The plant with another path before one input."""
        paths = list(self.input_paths)
        paths[channel] = replace(paths[channel], **changes)  # type: ignore[arg-type]
        return replace(self, input_paths=tuple(paths))
