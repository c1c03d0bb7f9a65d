"""The best possible test: everything known but the size of the effect, and parameters within tolerances projected out."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
import scipy.linalg
import scipy.stats

from benchmarks.blind_cases.excite import Run
from benchmarks.blind_cases.structure import DERIVATIVE, TOLERANCES, Array, Structure

LEVEL = 0.01
"""Probability of a false alarm at which powers are compared."""
STEP = 1e-3


def deflection(
    structure: Structure, runs: Sequence[Run], dt: float, change: Sequence[Array], noise: Array
) -> float:
    """How many standard deviations the effect moves the best statistic.

    The change d of the outputs that the effect makes, in units of the noise, is known but for its size. Parameters have slopes
    J per standard deviation of their tolerance, so what they leave to a test has the energy dᵀ (I + J Jᵀ)⁻¹ d.

    Args:
        structure: as built.
        runs: the records.
        dt: sample time [s].
        change: clean outputs with the effect less those without, one array per record.
        noise: RMS of the noise of every output, (n_outputs,).
    """
    d = (np.concatenate(change, axis=1) / noise[:, None]).ravel()
    J = slopes(structure, runs, dt, noise)
    along = J @ d
    known = np.eye(len(J)) + J @ J.T
    return float(np.sqrt(max(d @ d - along @ np.linalg.solve(known, along), 0.0)))


def slopes(structure: Structure, runs: Sequence[Run], dt: float, noise: Array) -> Array:
    """Outputs in units of the noise per standard deviation of every mass, stiffness and damping, (n_parameters, n)."""

    def outputs(changed: Structure) -> Array:
        parts = [linear(changed, run.inputs, dt) for run in runs]
        return np.asarray((np.concatenate(parts, axis=1) / noise[:, None]).ravel())

    nominal = outputs(structure)
    rows = []
    for kind, number in structure.parameters:
        moved = outputs(structure.scaled(kind, number, float(np.exp(STEP * TOLERANCES[kind]))))
        rows.append((moved - nominal) / STEP)
    return np.array(rows)


def linear(structure: Structure, u: Array, dt: float) -> Array:
    """Exact outputs of the linear structure under held forces, (n_outputs, n_samples)."""
    M, C, K = structure.matrices
    n, m = structure.n, len(structure.inputs)
    F = np.zeros((2 * n + m, 2 * n + m))
    F[:n, n : 2 * n] = np.eye(n)
    F[n : 2 * n, : 2 * n] = -np.linalg.solve(M, np.hstack([K, C]))
    for column, port in enumerate(structure.inputs):
        F[n + port.dof, 2 * n + column] = 1 / M[port.dof, port.dof]
    step = scipy.linalg.expm(F * dt)[: 2 * n]
    states = _states(np.ascontiguousarray(step), np.ascontiguousarray(u.T))  # (n_samples, 2 n + m)
    motions = (np.eye(2 * n + m)[:n], F[:n], F[n : 2 * n])
    rows = np.array([motions[DERIVATIVE[port.quantity]][port.dof] for port in structure.outputs])
    return np.asarray(rows @ states.T)


@numba.njit(cache=True)
def _states(step, u):  # type: ignore[no-untyped-def]
    n, m = step.shape[0], u.shape[1]
    out = np.zeros((u.shape[0], n + m))
    for k in range(u.shape[0]):
        out[k, n:] = u[k]
        if k + 1 < u.shape[0]:
            out[k + 1, :n] = step @ out[k]
    return out


def best_power(deflection_: float) -> float:
    """Probability that the likelihood-ratio test finds the effect at a false-alarm rate of `LEVEL`.

    Twice the log likelihood ratio is chi-square with one degree of freedom, noncentral by the squared deflection (Wilks 1938;
    Kay 1998, Fundamentals of Statistical Signal Processing II, 6.5).
    """
    return float(scipy.stats.ncx2.sf(scipy.stats.chi2.isf(LEVEL, 1), 1, deflection_**2))
