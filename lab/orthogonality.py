"""Cross-orthogonality: identified shapes against those of the model, weighed by the model's mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.recording import Array
from identification.systems import SecondOrder
from lab.result import Result
from lab.shapes import dof_shapes


@dataclass(frozen=True, eq=False)
class CrossOrthogonality:
    """Entries between -1 and 1, model by test.

    Attributes:
        values: of the paired modes, shape (n_pairs, n_pairs).
        dofs: degrees of freedom at which both shapes are known.
        n_dofs: of the model.
    """

    values: Array
    dofs: tuple[str, ...]
    n_dofs: int


def cross_orthogonality(result: Result) -> CrossOrthogonality | None:
    """φᵀ M ψ of model shapes φ and test shapes ψ, each of unit modal mass, in the order of the pairs.

    The model's shapes are its undamped ones; of the test's the real part is taken. Where a test knows fewer degrees of
    freedom than the model has, the model is reduced to those statically, which is the usual test-analysis model.

    Returns:
        The matrix; None without a model, or with fewer points than modes.

    Source: NASA-STD-5002; reduction by Guyan (1965), AIAA J. 3(2), 380.
    """
    truth, pairs = result.truth_second_order, () if result.comparison is None else result.comparison.pairs
    if truth is None or result.truth_modes is None or not pairs:
        return None
    shapes, known = dof_shapes(result, truth.dofs)
    own = [pair.estimate for pair in pairs]
    rows = np.flatnonzero(known[:, own].all(axis=1))
    if rows.size < len(pairs):
        return None
    M = _reduced_mass(truth, rows)
    if M is None:
        return None
    from scipy.optimize import linear_sum_assignment  # slow to load

    squares, normal = scipy.linalg.eigh(truth.stiffness, truth.mass)
    frequency_hz = np.sqrt(np.maximum(squares, 0)) / (2 * np.pi)
    wanted = result.truth_modes.frequency_hz[[pair.truth for pair in pairs]]
    _, nearest = linear_sum_assignment(np.abs(wanted[:, None] - frequency_hz))
    model, test = normal[rows][:, nearest], shapes[rows][:, own].real
    model, test = (each / np.sqrt(np.einsum("ik,ij,jk->k", each, M, each)) for each in (model, test))
    dofs = tuple(truth.dofs[row] for row in rows)
    return CrossOrthogonality(np.asarray(model.T @ M @ test), dofs, len(truth.dofs))


def _reduced_mass(model: SecondOrder, rows: NDArray[np.intp]) -> Array | None:
    """Mass reduced statically to some degrees of freedom; None where the others could move without force."""
    others = np.setdiff1d(np.arange(len(model.dofs)), rows)
    if not others.size:
        return model.mass[np.ix_(rows, rows)]
    K = model.stiffness
    inner = K[np.ix_(others, others)]
    level = np.linalg.eigvalsh(inner)
    if level[0] <= 1e-12 * level[-1]:
        return None
    T = np.zeros((len(model.dofs), rows.size))  # (n_dofs, n_rows)
    T[rows] = np.eye(rows.size)
    T[others] = -np.linalg.solve(inner, K[np.ix_(others, rows)])
    return np.asarray(T.T @ model.mass @ T)
