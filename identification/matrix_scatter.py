"""How far M, C_d and K may be off, from how far the model with inputs that they follow from may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from identification.parameterizations import Tangent
from identification.recording import Array
from identification.second_order import second_order
from identification.systems import SecondOrder

STEP = 1e-6
"""Relative step of a difference quotient."""


def matrices_with_std(matrices: SecondOrder, tangent: Tangent) -> SecondOrder:
    """M, C_d and K with the standard deviation of each entry.

    Args:
        matrices: those of the model.
        tangent: the model, and how it moves along independent directions, by one standard deviation along each.

    Returns:
        The same matrices with their standard deviations.

    Raises:
        NotSecondOrderError: a model so near has no such matrices.

    Source: first-order propagation, Kay (1993), eq. (3.30); of the matrices De Angelis et al. (2002), J. Appl. Mech. 69,
        eq. (18).
    """
    moves = [matrix_move(direction, matrices.dofs) for direction in _directions(tangent)]
    mass, damping, stiffness = (np.sqrt(np.sum(np.square(each), axis=0)) for each in zip(*moves, strict=True))
    return replace(matrices, mass_std=mass, damping_std=damping, stiffness_std=stiffness)


def _directions(tangent: Tangent) -> list[Tangent]:
    """One tangent per direction; no more directions than the model has parameters, for the same covariance."""
    names = ("A_theta", "B_theta", "C_theta", "D_theta")
    shapes = [getattr(tangent, name).shape[1:] for name in names]
    flat = np.hstack([getattr(tangent, name).reshape(len(tangent.A_theta), -1) for name in names])
    if flat.shape[0] > flat.shape[1]:
        flat = scipy.linalg.qr(flat, mode="r")[0][: flat.shape[1]]
    cuts = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
    rows = [np.split(row, cuts) for row in flat]
    return [
        Tangent(tangent.system, *(part.reshape(1, *shape) for part, shape in zip(row, shapes, strict=True)))
        for row in rows
    ]


def matrix_move(direction: Tangent, dofs: tuple[str, ...]) -> tuple[Array, Array, Array]:
    """How M, C_d and K move along the one direction of a tangent.

    Args:
        direction: a model and its derivative along one direction.
        dofs: degrees of freedom of the matrices.

    Returns:
        Central differences, shape (n_dofs, n_dofs) each.

    Source: of the matrices, De Angelis et al. (2002), J. Appl. Mech. 69, eq. (18).
    """
    system = direction.system
    steps = {name: getattr(direction, f"{name}_theta")[0] for name in "ABCD"}
    size = max(
        float(np.linalg.norm(step) / np.linalg.norm(getattr(system, name)))
        for name, step in steps.items()
        if np.any(getattr(system, name))
    )
    if size == 0:
        zero = np.zeros((len(dofs), len(dofs)))
        return zero, zero, zero
    h = STEP / size
    ahead, behind = (
        second_order(
            replace(
                system, **{name: getattr(system, name) + sign * h * step for name, step in steps.items()}
            ),
            dofs=dofs,
        )
        for sign in (1, -1)
    )
    return (
        (ahead.mass - behind.mass) / (2 * h),
        (ahead.damping - behind.damping) / (2 * h),
        (ahead.stiffness - behind.stiffness) / (2 * h),
    )
