"""From the covariance of parameters to standard deviations of M, C, K, frequencies and damping ratios."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from identification.modes import Modes
from identification.output_error import OutputError
from identification.parameterizations import Tangent
from identification.recording import Array
from identification.scoring import Curvature
from identification.structures import LinearStructure, Structure, StructureTangent
from identification.systems import SecondOrder

NOTHING = 1e-5
"""Relative share below which a combination of parameters has no part in something."""


def delta_method(covariance: Array, jacobian: Array, *, blind: Array | None = None) -> Array:
    """Standard deviation of functions of parameters, to first order, shape (n_functions,).

    Args:
        covariance: of the parameters, shape (n_parameters, n_parameters).
        jacobian: derivative of each function, shape (n_functions, n_parameters).
        blind: combinations of parameters that are not known at all, in columns; a function that one of them
            changes has an infinite standard deviation.

    Returns:
        Shape (n_functions,), in the unit of each function.

    Source: Kay (1993), eq. (3.30).
    """
    variance = np.einsum("fp,pq,fq->f", jacobian, covariance, jacobian, optimize=True)
    std = np.sqrt(np.maximum(variance, 0.0))
    if blind is None or not blind.shape[1]:
        return np.asarray(std)
    change, size = np.abs(jacobian @ blind), np.abs(jacobian) @ np.abs(blind)
    return np.asarray(np.where(np.any(change > NOTHING * size, axis=1), np.inf, std))


def covariance_of(information: Array, n_parameters: int) -> tuple[Array, Array]:
    """Covariance of the first parameters along what the data see, and what they do not see, in columns.

    Args:
        information: Fisher information of all unknowns, shape (n_unknowns, n_unknowns).
        n_parameters: how many of them matter; the others are eliminated.

    Returns:
        Shapes (n_parameters, n_parameters) and (n_parameters, n_blind).

    Source: Kay (1993), Fundamentals of Statistical Signal Processing I, eq. (3.20).
    """
    curvature = Curvature.of(information)
    seen, V = curvature.seen, curvature.eigenvectors[:n_parameters]
    rows = V / curvature.scale[:n_parameters, None]
    covariance = (rows[:, seen] / curvature.eigenvalues[seen]) @ rows[:, seen].T
    blind = np.where(np.abs(V) > NOTHING, rows, 0.0)[:, ~seen]
    return covariance, blind[:, np.any(blind, axis=0)]


def spread(
    problem: OutputError, q: Array, covariance: Array, blind: Array
) -> tuple[SecondOrder | None, Modes]:
    """M, C, K (None where the family has none) and the modes at q, with standard deviations.

    Args:
        problem: the fitting problem.
        q: unknowns.
        covariance: of the parameters.
        blind: combinations of parameters that are not known at all, in columns.

    Returns:
        The structure or None, and the modes.

    Source: as for `delta_method` and `modes_with_std`.
    """
    theta, family_of_models = q[: problem.n_theta], problem.parameterization
    structure = None
    if isinstance(family_of_models, LinearStructure | Structure):
        structure = _structure_with_std(family_of_models.matrices(theta), covariance, blind)
    return structure, modes_with_std(problem.tangent(q), covariance, blind=blind)


def modes_with_std(tangent: Tangent, covariance: Array, *, blind: Array | None = None) -> Modes:
    """Modes of a model with the standard deviations of their frequencies and damping ratios.

    Args:
        tangent: the model and its derivatives with respect to the parameters.
        covariance: of the parameters, shape (n_parameters, n_parameters).
        blind: as for `delta_method`.

    Returns:
        The modes, each with both standard deviations.

    Source: first-order perturbation of a simple eigenvalue, ∂λ = wᴴ ∂A v / wᴴ v.
    """
    system = tangent.system
    modes = system.modes()
    poles, left, right = scipy.linalg.eig(system.A, left=True, right=True)
    moved = np.einsum("ai,pab,bi->ip", left.conj(), tangent.A_theta, right, optimize=True)
    moved /= np.sum(left.conj() * right, axis=0)[:, None]
    if system.dt:
        moved, poles = moved / (poles[:, None] * system.dt), np.log(poles.astype(complex)) / system.dt
    pick = [int(np.argmin(np.abs(poles - pole))) for pole in modes.poles]
    pole, moved, omega = poles[pick, None], moved[pick], np.abs(poles[pick, None])
    d_omega = np.real(pole.conj() * moved) / omega
    d_zeta = -np.real(moved) / omega + np.real(pole) * d_omega / omega**2
    return replace(
        modes,
        frequency_std=delta_method(covariance, d_omega / (2 * np.pi), blind=blind),
        damping_std=delta_method(covariance, d_zeta, blind=blind),
    )


def _structure_with_std(tangent: StructureTangent, covariance: Array, blind: Array) -> SecondOrder:
    shape = tangent.structure.mass.shape
    M, C, K = (
        delta_method(covariance, d.reshape(len(d), -1).T, blind=blind).reshape(shape)
        for d in (tangent.M_theta, tangent.C_theta, tangent.K_theta)
    )
    return replace(tangent.structure, mass_std=M, damping_std=C, stiffness_std=K)
