"""State-space models written mode by mode, in real numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array

Complex = NDArray[np.complex128]


def modal_states(poles: Complex, participation: Complex) -> tuple[Array, Array]:
    """A and B with the given poles; the states of a complex pole are real and imaginary part of its coordinate.

    Args:
        poles: one of each conjugate pair, and real ones, shape (n_poles,).
        participation: l of each pole, shape (n_poles, n_inputs); that of a real pole is real.

    Returns:
        A, shape (n_states, n_states), and B, shape (n_states, n_inputs), of q' = p q + l u.
    """
    first = np.cumsum(widths(poles)) - widths(poles)
    n = int(np.sum(widths(poles)))
    A, B = np.zeros((n, n)), np.zeros((n, participation.shape[1]))
    A[first, first] = poles.real
    B[first] = participation.real
    two = poles.imag != 0
    k = first[two]
    A[k, k + 1] = -poles.imag[two]
    A[k + 1, k] = poles.imag[two]
    A[k + 1, k + 1] = poles.real[two]
    B[k + 1] = participation.imag[two]
    return A, B


def modal_outputs(poles: Complex, shapes: Complex) -> Array:
    """C with the given shapes, for the states of `modal_states`: y = 2 Re φ q, or φ q for a real pole.

    Args:
        poles: shape (n_poles,).
        shapes: φ, shape (n_outputs, n_poles); that of a real pole is real.

    Returns:
        Shape (n_outputs, n_states).
    """
    columns = []
    for pole, shape in zip(poles, shapes.T, strict=True):
        columns += [2 * shape.real, -2 * shape.imag] if pole.imag else [shape.real]
    return np.array(columns).T.reshape(shapes.shape[0], -1)


def modal_gains(poles: Complex, participation: Complex, points: Complex) -> Complex:
    """(p I - A)⁻¹ B for the states of `modal_states`, at every point p.

    Args:
        poles: sampled, one of each conjugate pair, shape (n_poles,).
        participation: rows of B as of `modal_states`, shape (n_poles, n_inputs).
        points: shape (n_points,).

    Returns:
        Shape (n_points, n_states, n_inputs).
    """
    own = 1 / (points[:, None] - poles)  # (n_points, n_poles)
    partner = 1 / (points[:, None] - poles.conj())
    g = own[..., None] * participation
    h = partner[..., None] * participation.conj()
    first = np.cumsum(widths(poles)) - widths(poles)
    X = np.empty((points.size, int(np.sum(widths(poles))), participation.shape[1]), complex)
    X[:, first] = (g + h) / 2
    two = poles.imag != 0
    X[:, first[two] + 1] = (g[:, two] - h[:, two]) / 2j
    return X


def widths(poles: Complex) -> NDArray[np.intp]:
    """States of each pole: two for a complex one, which stands for its conjugate too, and one for a real one.

    Args:
        poles: one of each conjugate pair, shape (n_poles,).

    Returns:
        Shape (n_poles,).
    """
    return np.where(poles.imag != 0, 2, 1)
