"""Confusion: how likely one cause is named where another is at work, from the products of their effects.

Data are the effect of the cause at work plus Gaussian noise; each cause is fitted with a size of its own, and the one
that fits best is named. In units of the noise an effect is a vector a, a rival one along b; what counts is the length
of a and the cosine ρ of the angle between the two.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from identification.recording import Array

DRAWS = 2000
"""Of the noise: a probability of a tenth is then known to 0.007."""


def confusion(length: Array, cosine: Array) -> Array:
    """Probability that the rival fits better than the cause at work.

    Args:
        length: of the effect, in standard deviations of the noise.
        cosine: of the angle between effect and rival.

    With x the data, the rival wins where |x·b| > |x·a| for unit vectors a and b. The two are jointly Gaussian, so that
    u = x·a + x·b and v = x·a - x·b are independent, and the rival wins where they differ in sign.

    Source: Kay (1998), Fundamentals of Statistical Signal Processing II, section 6.4.2, for the test.
    """
    u = ndtr(-length * np.sqrt(np.clip((1 + cosine) / 2, 0, 1)))  # P(u < 0)
    v = ndtr(-length * np.sqrt(np.clip((1 - cosine) / 2, 0, 1)))
    return np.asarray(u * (1 - v) + (1 - u) * v)


def mistaken(length: Array, cosine: Array, alike: np.ndarray, *, n_draws: int = DRAWS) -> Array:
    """Probability that any of many rivals fits better than the cause at work, from drawn data; shape (k,).

    Args:
        length: of each effect, in standard deviations of the noise, shape (k,).
        cosine: between effects, shape (k, k).
        alike: effects that count as right where the other is at work, shape (k, k).
        n_draws: draws of the noise, the same for every cause; a probability p errs by about √(p (1 - p) / n_draws).

    With x the data, the cause is named whose |x·b| is largest among the unit vectors b, jointly Gaussian with the
    covariance that the cosines are.
    """
    values, vectors = np.linalg.eigh(cosine)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    noise = np.random.default_rng(0).standard_normal((n_draws, len(values))) @ root.T
    wrong = np.zeros(len(length))
    for i, right in enumerate(alike):
        if not np.all(right):
            fit = np.abs(noise + length[i] * cosine[i])
            wrong[i] = np.mean(np.max(fit[:, ~right], axis=1) > np.max(fit[:, right], axis=1))
    return wrong


def without(products: Array, n: int, precision: Array) -> Array:
    """Products of effects in the metric of noise and of parameters that are known to a prior only.

    Args:
        products: of the slopes of n parameters and of the effects, over the noise; shape (n + k, n + k).
        n: number of parameters.
        precision: of their prior, shape (n, n).

    Returns:
        Shape (k, k): aᵀ (Σ + J P⁻¹ Jᵀ)⁻¹ b for noise Σ and slopes J.

    Source: Woodbury (1950), Memo 42, Statistical Research Group, Princeton.
    """
    own, cross = products[:n, :n] + precision, products[:n, n:]
    return np.asarray(products[n:, n:] - cross.T @ np.linalg.solve(own, cross))


def lengths_and_cosines(products: Array) -> tuple[Array, Array]:
    """Lengths of effects, shape (k,), and the cosines between them, shape (k, k), from their products."""
    length = np.sqrt(np.maximum(np.diag(products), 0.0))
    unit = np.where(length > 0, length, 1.0)
    return length, np.clip(products / unit / unit[:, None], -1.0, 1.0)
