"""Structures whose mass, damping and stiffness depend on parameters, instrumented or not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.errors import IdentificationError, NotSecondOrderError
from identification.parameterizations import Tangent, start_values
from identification.recording import DERIVATIVE, Array, Channel, frozen
from identification.second_order import second_order
from identification.systems import Realization, SecondOrder, StateSpace


@dataclass(frozen=True, eq=False)
class StructureTangent:
    """Mass, damping and stiffness, and how they move with each parameter.

    Attributes:
        structure: the matrices at θ.
        M_theta, C_theta, K_theta: their derivatives, shape (n_parameters, n_dofs, n_dofs).
    """

    structure: SecondOrder
    M_theta: Array
    C_theta: Array
    K_theta: Array

    def instrumented(self, inputs: Sequence[Channel], outputs: Sequence[Channel]) -> Tangent:
        """The state space seen through these channels, with its derivatives.

        Raises:
            NotSecondOrderError: a channel neither drives nor reads the motion of a known degree of freedom.

        Source: De Angelis et al. (2002), J. Appl. Mech. 69, eq. (1) and (7), differentiated.
        """
        s = self.structure
        B, C_p, C_v, C_a = channel_matrices(s.dofs, inputs, outputs)
        W = np.linalg.inv(s.mass)
        WB, WC, WK = W @ B, W @ s.damping, W @ s.stiffness
        # ∂(M⁻¹ X) = M⁻¹ (∂X - ∂M M⁻¹ X)
        dWB, dWC, dWK = (
            W @ (-self.M_theta @ WB),
            W @ (self.C_theta - self.M_theta @ WC),
            W @ (self.K_theta - self.M_theta @ WK),
        )
        n, p = len(s.dofs), len(self.M_theta)
        zero = np.zeros((n, n))
        system = StateSpace(
            np.block([[zero, np.eye(n)], [-WK, -WC]]),
            np.vstack([np.zeros_like(WB), WB]),
            np.hstack([C_p - C_a @ WK, C_v - C_a @ WC]),
            C_a @ WB,
            0.0,
            tuple(inputs),
            tuple(outputs),
        )
        dA = np.zeros((p, 2 * n, 2 * n))
        dA[:, n:, :n], dA[:, n:, n:] = -dWK, -dWC
        dB = np.concatenate([np.zeros_like(dWB), dWB], axis=1)
        dC = np.concatenate([-C_a @ dWK, -C_a @ dWC], axis=2)
        return Tangent(system, dA, dB, dC, C_a @ dWB)


@dataclass(frozen=True, eq=False)
class Structure:
    """M, C_d and K as any smooth function of parameters, such as those of a model file.

    Attributes:
        names: one per parameter.
        matrices: θ, shape (n_parameters,), to the matrices and their derivatives.
    """

    names: tuple[str, ...]
    matrices: Callable[[Array], StructureTangent]

    def start(self, model: Any) -> Array:
        """The start values as they are."""
        return start_values(model, self.names)

    def tangent(self, theta: Array, inputs: Sequence[Channel], outputs: Sequence[Channel]) -> Tangent:
        """The state space at θ seen through these channels, with its derivatives."""
        return self.matrices(theta).instrumented(inputs, outputs)


@dataclass(frozen=True, eq=False)
class LinearStructure:
    """M, C_d and K as sums of known patterns, each times one parameter, on top of known matrices.

    Attributes:
        names: one per parameter.
        known: what does not depend on the parameters.
        mass, damping, stiffness: the pattern of each parameter, shape (n_parameters, n_dofs, n_dofs).
    """

    names: tuple[str, ...]
    known: SecondOrder
    mass: Array
    damping: Array
    stiffness: Array

    def __post_init__(self) -> None:
        n = len(self.known.dofs)
        for name in ("mass", "damping", "stiffness"):
            pattern = frozen(getattr(self, name))
            if pattern.shape != (len(self.names), n, n):
                raise IdentificationError(
                    f"{name} patterns have shape {pattern.shape}; expected ({len(self.names)}, {n}, {n})"
                )
            object.__setattr__(self, name, pattern)

    def start(self, model: Any) -> Array:
        """θ by least squares from given matrices, or from the matrices behind a state space.

        Args:
            model: a `SecondOrder` with the same degrees of freedom in any order, a `StateSpace` or
                `Realization` with two states for each, or θ itself.

        Raises:
            NotSecondOrderError: the degrees of freedom differ, or the state space has no such matrices.
        """
        if isinstance(model, Realization):
            model = model.system
        if isinstance(model, StateSpace):
            model = second_order(model, dofs=self.known.dofs)
        if not isinstance(model, SecondOrder):
            return start_values(model, self.names)
        if set(model.dofs) != set(self.known.dofs):
            raise NotSecondOrderError(
                f"the start has degrees of freedom {', '.join(model.dofs)}; expected {', '.join(self.known.dofs)}"
            )
        rank = [model.dofs.index(dof) for dof in self.known.dofs]
        rows, rhs = [], []
        for name in ("mass", "damping", "stiffness"):
            target = getattr(model, name)[np.ix_(rank, rank)] - getattr(self.known, name)
            unit = np.max(np.abs(getattr(model, name))) or 1.0
            rows.append(getattr(self, name).reshape(len(self.names), -1).T / unit)
            rhs.append(target.ravel() / unit)
        return np.asarray(np.linalg.lstsq(np.vstack(rows), np.concatenate(rhs), rcond=None)[0])

    def stable(self, theta: Array) -> Array:
        """The θ that comes closest to the structure at θ made `passive`."""
        return self.start(passive(self.matrices(theta).structure))

    def matrices(self, theta: Array) -> StructureTangent:
        """The matrices at θ and their patterns."""
        M, C, K = (
            getattr(self.known, name) + np.tensordot(theta, getattr(self, name), 1)
            for name in ("mass", "damping", "stiffness")
        )
        structure = SecondOrder(M, C, K, self.known.dofs)
        return StructureTangent(structure, self.mass, self.damping, self.stiffness)

    def tangent(self, theta: Array, inputs: Sequence[Channel], outputs: Sequence[Channel]) -> Tangent:
        """The state space at θ seen through these channels, with its derivatives."""
        return self.matrices(theta).instrumented(inputs, outputs)


def free_matrices(dofs: Sequence[str]) -> LinearStructure:
    """Every entry on and above the diagonal of M, C_d and K is a parameter.

    Args:
        dofs: names of the degrees of freedom.

    Returns:
        The parameters M[i,j], then C[i,j], then K[i,j], named by degrees of freedom, row by row.
    """
    n = len(dofs)
    entries = [(i, j) for i in range(n) for j in range(i, n)]
    pattern = np.zeros((len(entries), n, n))
    for p, (i, j) in enumerate(entries):
        pattern[p, i, j] = pattern[p, j, i] = 1.0
    names = tuple(f"{matrix}[{dofs[i]},{dofs[j]}]" for matrix in "MCK" for i, j in entries)
    return in_three_parts(names, dofs, (pattern, pattern, pattern))


def in_three_parts(
    names: tuple[str, ...],
    dofs: Sequence[str],
    parts: tuple[Array, Array, Array],
    known_mass: Array | None = None,
) -> LinearStructure:
    """Structure whose parameters belong to the mass first, then to the damping, then to the stiffness.

    Args:
        names: one per parameter.
        dofs: names of the degrees of freedom.
        parts: patterns of mass, damping and stiffness, each (n_patterns, n_dofs, n_dofs).
        known_mass: what the mass has besides, shape (n_dofs, n_dofs); nothing when None.

    Returns:
        The structure as a function of its parameters.
    """
    n = len(dofs)
    zero = np.zeros((n, n))
    known = SecondOrder(zero if known_mass is None else known_mass, zero, zero, tuple(dofs))
    blocks = np.split(np.zeros((len(names), 3, n, n)), np.cumsum([len(part) for part in parts])[:2])
    for position, (block, part) in enumerate(zip(blocks, parts, strict=True)):
        block[:, position] = part
    patterns = np.concatenate(blocks)
    return LinearStructure(names, known, patterns[:, 0], patterns[:, 1], patterns[:, 2])


def passive(structure: SecondOrder) -> SecondOrder:
    """The structure without what noise may add to it and nature cannot: negative mass, stiffness and damping.

    Args:
        structure: symmetric M, C_d and K.

    Returns:
        Eigenvalues of the mass (in units of its diagonal) raised to a hundredth of the largest at least, those of
        the stiffness relative to the mass to a millionth, those of the damping to zero.
    """
    unit = np.sqrt(np.maximum(np.abs(np.diag(structure.mass)), np.finfo(float).tiny))
    m, V = np.linalg.eigh(structure.mass / unit / unit[:, None])
    V = V / unit[:, None] / np.sqrt(np.maximum(m, m[-1] / 100))  # Vᵀ M V = I
    back = np.linalg.inv(V)

    def raised(matrix: Array, share: float) -> Array:
        k, W = np.linalg.eigh(V.T @ matrix @ V)
        W = W.T @ back
        return np.asarray((W.T * np.maximum(k, share * k[-1])) @ W)

    return SecondOrder(
        back.T @ back, raised(structure.damping, 0.0), raised(structure.stiffness, 1e-6), structure.dofs
    )


def channel_matrices(
    dofs: Sequence[str], inputs: Sequence[Channel], outputs: Sequence[Channel]
) -> tuple[Array, Array, Array, Array]:
    """Where the channels sit: f = B u and y = C_p q + C_v q̇ + C_a q̈.

    Args:
        dofs: degrees of freedom.
        inputs: input channels.
        outputs: output channels.

    Returns:
        B, shape (n_dofs, n_inputs), and C_p, C_v, C_a, each (n_outputs, n_dofs).

    Raises:
        NotSecondOrderError: a channel neither drives nor reads the motion of one of `dofs`.
    """
    B = np.zeros((len(dofs), len(inputs)))
    C = np.zeros((3, len(outputs), len(dofs)))
    for channel in (*inputs, *outputs):
        if channel.dof not in dofs:
            raise NotSecondOrderError(
                f"channel {channel.name!r} has dof {channel.dof!r}; expected one of {', '.join(dofs)}; set it, or "
                "select the other channels"
            )
    for j, channel in enumerate(inputs):
        B[dofs.index(channel.dof), j] = channel.factor
    for i, channel in enumerate(outputs):
        if channel.quantity not in DERIVATIVE:
            raise NotSecondOrderError(
                f"output {channel.name!r} measures {channel.quantity}; expected {', '.join(DERIVATIVE)}; select the "
                "other channels"
            )
        C[DERIVATIVE[channel.quantity], i, dofs.index(channel.dof)] = channel.factor
    return B, C[0], C[1], C[2]
