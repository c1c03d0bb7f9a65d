"""Modes as parameters: poles, shapes at the outputs and participation of the inputs, any state space in short.

Each complex pole z has a state q with q⁺ = z q + b u and adds Re(c q) to the outputs; a real pole likewise.
Scaling c up and b down changes nothing, so the largest entry of each c stays as it is at the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.modes import Modes
from identification.parameterizations import Tangent, require_channels, start_values
from identification.recording import Array, Channel
from identification.systems import Realization, StateSpace

Complex = NDArray[np.complex128]
Entry = tuple[str, int, int, float]
"""A matrix, row, column, and how much of a parameter goes there."""

IMMEDIATE = ("displacement", "velocity")
"""What cannot answer a force at once: no direct term unless the start has one."""


@dataclass(frozen=True, eq=False)
class ModalParameters:
    """State spaces near a given one, by poles, shapes, participation and direct terms.

    Every matrix is linear in the parameters.

    Attributes:
        names: one per parameter.
        origin: the model where all parameters are zero.
        slope: how the matrices move with the parameters.
        values: the parameters of the given model.
        unknown: which ones the given model did not tell: participation and direct terms of inputs that it
            lacks. The outputs are linear in them.
        poles: positions of the real and imaginary part of each pole, -1 where it is real.
    """

    names: tuple[str, ...]
    origin: StateSpace
    slope: Tangent
    values: Array
    unknown: NDArray[np.bool_]
    poles: tuple[tuple[int, int], ...]

    def start(self, model: Any) -> Array:
        """The parameters of the model that this was made from, or θ itself when that is given."""
        return start_values(model, self.names) if isinstance(model, np.ndarray) else self.values

    def stable(self, theta: Array) -> Array:
        """θ with growing poles turned into decaying ones: reflected at the unit circle or the imaginary axis."""
        theta = theta.copy()
        for real, imag in self.poles:
            z = complex(theta[real], 0.0 if imag < 0 else theta[imag])
            z = z / max(abs(z) ** 2, 1.0) if self.origin.dt else complex(-abs(z.real), z.imag)
            theta[real] = z.real
            if imag >= 0:
                theta[imag] = z.imag
        return theta

    def tangent(self, theta: Array, inputs: Sequence[Channel], outputs: Sequence[Channel]) -> Tangent:
        """The model at θ, with its derivatives.

        Raises:
            IdentificationError: the model has other channels.
        """
        require_channels(self.origin, inputs, outputs)
        s, origin = self.slope, self.origin
        A, B, C, D = (
            at_zero + np.tensordot(theta, slope, 1)
            for at_zero, slope in (
                (origin.A, s.A_theta),
                (origin.B, s.B_theta),
                (origin.C, s.C_theta),
                (origin.D, s.D_theta),
            )
        )
        system = StateSpace(A, B, C, D, origin.dt, origin.inputs, origin.outputs)
        return Tangent(system, s.A_theta, s.B_theta, s.C_theta, s.D_theta)


def modal_parameters(
    model: StateSpace | Realization | Modes, *, inputs: Sequence[Channel], dt: float | None = None
) -> ModalParameters:
    """The modal parameters of a model, with its own values as the start.

    Args:
        model: sampled or continuous state space, or modes, which have no participation and start with none.
        inputs: input channels wanted; the participation of those that the model lacks starts at zero.
        dt: sample time [s] of modes; needed for them alone.

    Returns:
        The family around that model.

    Raises:
        IdentificationError: modes without a sample time.
    """
    if isinstance(model, Realization):
        model = model.system
    parts = _of_modes(model, inputs, dt) if isinstance(model, Modes) else _of_system(model, inputs)
    form = _Builder(parts, tuple(inputs), model.outputs)
    for i in range(parts.z.size):
        form.add_pole(i)
    for o, output in enumerate(model.outputs):
        for j, channel in enumerate(inputs):
            if parts.D[o, j] or output.quantity not in IMMEDIATE:
                name = f"D[{output.name},{channel.name}]"
                form.add(name, parts.D[o, j], [("D", o, j, 1.0)], known=parts.known[j])
    return form.finish()


class _Parts(NamedTuple):
    """Poles with Im z >= 0, shapes (n_outputs, n_poles), participation (n_poles, n_inputs), direct terms."""

    z: Complex
    c: Complex
    b: Complex
    D: Array
    known: list[bool]
    dt: float


def _of_system(system: StateSpace, inputs: Sequence[Channel]) -> _Parts:
    poles, phi = scipy.linalg.eig(system.A)
    own = poles.imag >= 0
    twice = np.where(poles.imag > 0, 2.0, 1.0)
    have = [channel.name for channel in system.inputs]
    known = [channel.name in have for channel in inputs]
    columns = [have.index(channel.name) for channel in inputs if channel.name in have]
    b = np.zeros((system.n_states, len(inputs)), dtype=complex)
    D = np.zeros((len(system.outputs), len(inputs)))
    b[:, known] = np.linalg.solve(phi, system.B.astype(complex))[:, columns]
    D[:, known] = system.D[:, columns]
    c = system.C @ phi * twice
    return _Parts(poles[own], c[:, own], b[own], D, known, system.dt)


def _of_modes(modes: Modes, inputs: Sequence[Channel], dt: float | None) -> _Parts:
    if not dt:
        raise IdentificationError("modes have no sample time of their own; give dt [s]")
    n_outputs, n_modes = modes.shapes.shape
    b = np.zeros((n_modes, len(inputs)), dtype=complex)
    D = np.zeros((n_outputs, len(inputs)))
    return _Parts(np.exp(modes.poles * dt), modes.shapes, b, D, [False] * len(inputs), dt)


class _Builder:
    """Collects parameters and where each of them enters the matrices."""

    def __init__(self, parts: _Parts, inputs: tuple[Channel, ...], outputs: tuple[Channel, ...]) -> None:
        self.parts, self.inputs, self.outputs = parts, inputs, outputs
        n = parts.z.size + int(np.count_nonzero(parts.z.imag))
        n_inputs, n_outputs = len(inputs), len(outputs)
        self.shapes: dict[str, tuple[int, int]] = {
            "A": (n, n),
            "B": (n, n_inputs),
            "C": (n_outputs, n),
            "D": (n_outputs, n_inputs),
        }
        self.origin = {name: np.zeros(shape) for name, shape in self.shapes.items()}
        self.names: list[str] = []
        self.values: list[float] = []
        self.unknown: list[bool] = []
        self.entries: list[list[Entry]] = []
        self.poles: list[tuple[int, int]] = []
        self.state = 0

    def add(self, name: str, value: float, entries: list[Entry], *, known: bool = True) -> None:
        self.names.append(name)
        self.values.append(float(value))
        self.entries.append(entries)
        self.unknown.append(not known)

    def add_pole(self, i: int) -> None:
        """A complex pole has the states Re q and Im q: q⁺ = z q + b u and Re(c q) = Re c Re q - Im c Im q."""
        z, c, b, k = self.parts.z[i], self.parts.c[:, i], self.parts.b[i], self.state
        parts = [("Re", 0, 1.0), ("Im", 1, -1.0)][: 2 if z.imag else 1]
        self.state += len(parts)
        name, here = f"pole {i + 1}", len(self.names)
        self.poles.append((here, here + 1 if z.imag else -1))
        self.add(f"Re {name}", z.real, [("A", k + part, k + part, 1.0) for _, part, _ in parts])
        if z.imag:
            self.add(f"Im {name}", z.imag, [("A", k, k + 1, -1.0), ("A", k + 1, k, 1.0)])
        anchor = int(np.argmax(np.abs(c)))
        for label, part, sign in parts:
            self.origin["C"][anchor, k + part] = sign * (c[anchor].imag if part else c[anchor].real)
            for o, output in enumerate(self.outputs):
                if o != anchor:
                    value = c[o].imag if part else c[o].real
                    self.add(f"{label} shape {name} {output.name}", value, [("C", o, k + part, sign)])
            for j, channel in enumerate(self.inputs):
                value = b[j].imag if part else b[j].real
                entry = ("B", k + part, j, 1.0)
                known = self.parts.known[j]
                self.add(f"{label} participation {name} {channel.name}", value, [entry], known=known)

    def finish(self) -> ModalParameters:
        d = {name: np.zeros((len(self.names), *shape)) for name, shape in self.shapes.items()}
        for p, entries in enumerate(self.entries):
            for matrix, row, column, coefficient in entries:
                d[matrix][p, row, column] = coefficient
        A, B, C, D = (self.origin[name] for name in "ABCD")
        origin = StateSpace(A, B, C, D, self.parts.dt, self.inputs, self.outputs)
        slope = Tangent(origin, d["A"], d["B"], d["C"], d["D"])
        unknown = np.array(self.unknown, dtype=bool)
        return ModalParameters(
            tuple(self.names), origin, slope, np.array(self.values), unknown, tuple(self.poles)
        )
