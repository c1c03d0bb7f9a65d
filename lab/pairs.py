"""Pairs: states in which a linear structure is nothing but separate swings, two states each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.recording import Array

NEARLY_PARALLEL = 1e5
"""Condition beyond which swings are not told apart well enough: rigid-body motion, equal frequencies with critical damping."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Coordinates z of a state x = `shapes` z, of which each mixes with its partner only, half of them away.

    Attributes:
        shapes: (n_states, n_pairs), an even number of columns.
        inverse: (n_pairs, n_states).
        turns: share of its own, and of its partner's, that each coordinate is after a step, (2, n_pairs).
    """

    shapes: Array
    inverse: Array
    turns: Array


def pairs_of(F: Array) -> Pairs | None:
    """Pairs of a transition matrix F, (n_states, n_states); None where they are not told apart."""
    if not np.all(np.isfinite(F)):
        return None
    units = _units(F)
    values, vectors = np.linalg.eig(F * units / units[:, None])
    upper, real = np.flatnonzero(values.imag > 0), np.flatnonzero(values.imag == 0)
    # Real ones fill both halves; a column of zeros stands beside the last one of an odd number.
    first, second = np.append(upper, real[::2]), np.append(upper, real[1::2])
    shapes = np.concatenate(
        [vectors[:, first].real, vectors[:, upper].imag, vectors[:, real[1::2]].real], axis=1
    )
    try:
        inverse = np.linalg.inv(shapes)
    except np.linalg.LinAlgError:
        return None
    if not np.linalg.norm(inverse) * np.linalg.norm(shapes) < NEARLY_PARALLEL:
        return None
    shapes, inverse = units[:, None] * shapes, inverse / units
    turns = np.zeros((2, 2 * first.size))
    turns[0, : first.size], turns[0, first.size : first.size + second.size] = (
        values[first].real,
        values[second].real,
    )
    turns[1, : upper.size], turns[1, first.size :][: upper.size] = values[upper].imag, -values[upper].imag
    if first.size > second.size:
        shapes = np.concatenate([shapes, np.zeros((len(shapes), 1))], axis=1)
        inverse = np.concatenate([inverse, np.zeros((1, len(shapes)))])
    return Pairs(shapes, inverse, turns)


def _units(F: Array) -> Array:
    """Units of the states in which rows and columns of a transition are about as large, so that a condition means something."""
    coupling = np.abs(F)
    np.fill_diagonal(coupling, 0.0)
    rows, columns = coupling.max(axis=1), coupling.max(axis=0)
    both = (rows > 0) & (columns > 0)
    return np.asarray(np.sqrt(np.where(both, rows, 1.0) / np.where(both, columns, 1.0)))
