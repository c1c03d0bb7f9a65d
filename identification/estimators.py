"""Frequency response functions from the moments of spectra: which side of the measurement carries the noise.

With Y = H U + noise at each line, H1 takes the noise to be on the output, H2 on the inputs, and Hv on both
in proportion to their power. Where there is no noise they agree.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array

Complex = NDArray[np.complex128]


class Moments(NamedTuple):
    """Sums over all pieces at each line.

    Attributes:
        uu: Σ U Uᴴ, shape (n_frequencies, n_inputs, n_inputs).
        yu: Σ Y Uᴴ, shape (n_frequencies, n_outputs, n_inputs).
        yy: Σ |Y|² of each output, shape (n_frequencies, n_outputs).
    """

    uu: Complex
    yu: Complex
    yy: Array

    def take(self, lines: NDArray[np.bool_]) -> Moments:
        """The moments at the given lines."""
        return Moments(self.uu[lines], self.yu[lines], self.yy[lines])


def h1(moments: Moments) -> Complex:
    """H = Y Uᴴ (U Uᴴ)⁻¹: least squares with the error on the outputs, shape (n_frequencies, n_outputs, n_inputs).

    Args:
        moments: of inputs and outputs.

    Returns:
        Responses in the unit of the output per unit of the input.

    Source: Bendat and Piersol (2010), Random Data, eq. (7.62); Rocklin, Crowley and Vold (1985), Proc. 3rd
        IMAC, 272-278.
    """
    return _solve(moments.uu, moments.yu)


def h2(moments: Moments) -> Complex:
    """H with the error on the inputs, in proportion to the power of each; Σ|Y|² / Σ U Y* for one input.

    The row (H, -1) is the one that the moments of inputs and output make smallest, per power of the error.
    For each output, what it does not explain of the inputs, S = U Uᴴ - U Yᴴ (Y Yᴴ)⁻¹ Y Uᴴ, has the
    direction of H for its least eigenvector.

    Args:
        moments: of inputs and outputs.

    Returns:
        Shape (n_frequencies, n_outputs, n_inputs).

    Source: Rocklin, Crowley and Vold (1985), Proc. 3rd IMAC, 272-278, for each output by itself.
    """
    uu, uy, yy, size = _relative(moments)
    S = uu[:, None] - uy[..., :, None] * uy.conj()[..., None, :]
    h = np.linalg.eigh(S)[1][..., 0].conj()  # (n_frequencies, n_outputs, n_inputs)
    return _scaled(h, np.sum(h * uy, axis=-1), yy, size)


def hv(moments: Moments) -> Complex:
    """H with the error on inputs and output alike, in proportion to the power of each.

    The geometric mean of H1 and H2 for one input. For several it is the least eigenvector of the moments of
    all inputs with one output, each divided by its power.

    Args:
        moments: of inputs and outputs.

    Returns:
        Shape (n_frequencies, n_outputs, n_inputs).

    Source: Rocklin, Crowley and Vold (1985), Proc. 3rd IMAC, 272-278.
    """
    uu, uy, yy, size = _relative(moments)
    n_lines, n_outputs, n_inputs = uy.shape
    G = np.ones((n_lines, n_outputs, n_inputs + 1, n_inputs + 1), complex)
    G[..., :-1, :-1] = uu[:, None]
    G[..., :-1, -1] = uy
    G[..., -1, :-1] = uy.conj()
    v = np.linalg.eigh(G)[1][..., 0].conj()
    return _scaled(v[..., :-1], -v[..., -1], yy, size)


ESTIMATORS: dict[str, Callable[[Moments], Complex]] = {"H1": h1, "H2": h2, "Hv": hv}
"""Name -> estimator."""


def multiple_coherence(moments: Moments) -> Array:
    """Share of each output's power that the inputs explain, 0 to 1, shape (n_frequencies, n_outputs).

    Args:
        moments: of inputs and outputs.

    Returns:
        Zero for an output that does not move.

    Source: Bendat and Piersol (2010), Random Data, eq. (7.35) and (7.36).
    """
    share = _explained(moments) / np.where(moments.yy > 0, moments.yy, 1)
    return np.clip(share, 0, 1)


def residual_variance(moments: Moments, n_averages: float) -> Array:
    """E|ΔH|² of H1 from what the inputs leave unexplained, shape (n_frequencies, n_outputs, n_inputs).

    Args:
        moments: sums over the pieces.
        n_averages: number of independent pieces, more than there are inputs.

    Returns:
        In the square of the unit of H.

    Source: Bendat and Piersol (2010), Random Data, eq. (9.99), as the covariance of least squares.
    """
    left = np.maximum(moments.yy - _explained(moments), 0) / (n_averages - moments.uu.shape[1])
    inverse = np.linalg.inv(moments.uu)
    return np.asarray(left[..., None] * np.einsum("fii->fi", inverse).real[:, None])


def line_weight(moments: Moments) -> Array:
    """What the inputs alone tell of how well each line is known: 1 / standard deviation of H, 1 on average.

    Each input counts by its share of its own power. Where inputs are weak, or nearly copies of one another,
    the noise on the outputs comes out large.

    Args:
        moments: of inputs and outputs.

    Returns:
        Shape (n_frequencies,).
    """
    power = np.mean(np.einsum("fii->fi", moments.uu).real, axis=0)
    size = np.sqrt(power)
    inverse = np.linalg.inv(moments.uu / size[:, None] / size)
    weight = 1 / np.sqrt(np.einsum("fii->f", inverse).real)
    return np.asarray(weight / np.mean(weight))


def excited(moments: Moments) -> NDArray[np.bool_]:
    """Lines at which every input acts by itself: with power to speak of, and not as a copy of the others.

    Args:
        moments: of inputs and outputs.

    Returns:
        Shape (n_frequencies,).
    """
    power = np.einsum("fii->fi", moments.uu).real
    floor = 1e-12 * np.max(power, axis=0, initial=0.0)
    acts = np.all((power > floor) & (power > 0), axis=1)
    size = np.sqrt(np.where(acts[:, None], power, 1))
    apart = np.linalg.eigvalsh(moments.uu / size[:, :, None] / size[:, None])[:, 0] > 1e-10
    return np.asarray(acts & apart)


def _solve(uu: Complex, yu: Complex) -> Complex:
    """Y Uᴴ (U Uᴴ)⁻¹ with the inputs brought to one scale first."""
    size = np.sqrt(np.einsum("fii->fi", uu).real)
    scaled = uu / size[:, :, None] / size[:, None]
    X = np.linalg.solve(scaled, (yu / size[:, None]).conj().transpose(0, 2, 1))
    return np.asarray(X.conj().transpose(0, 2, 1) / size[:, None])


def _explained(moments: Moments) -> Array:
    return np.asarray(np.sum(h1(moments) * moments.yu.conj(), axis=2).real)


def _relative(moments: Moments) -> tuple[Complex, Complex, Array, Array]:
    """Moments of channels with a power of one, and the roots of their powers."""
    size = np.sqrt(np.einsum("fii->fi", moments.uu).real)
    root = np.sqrt(moments.yy)
    alive = np.where(root > 0, root, 1)
    uu = moments.uu / size[:, :, None] / size[:, None]
    uy = moments.yu.conj() / size[:, None] / alive[..., None]  # (n_frequencies, n_outputs, n_inputs)
    return uu, uy, root, size


def _scaled(h: Complex, y: Complex, root: Array, size: Array) -> Complex:
    """H = h / y in the units of the channels; zero for an output that does not move."""
    factor = np.where(root > 0, root, 0) / np.where(root > 0, y, 1)
    return np.asarray(h * factor[..., None] / size[:, None])
