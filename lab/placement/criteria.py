"""Criteria: how good a layout is, as a function of the sum of what its blocks of channels bring.

Every block of channels brings a positive semidefinite matrix g, and a layout has their sum G = Σ g. Larger scores are
better. Where a score is concave in G, its slope bounds what any other layout can reach.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identification.recording import Array

SINGULAR = 1e-13
"""Smallest over largest eigenvalue below which an information counts as singular."""


@dataclass(frozen=True)
class Criterion:
    """A score of layouts.

    Attributes:
        name: short.
        measure: what the figure is, in words; smaller figures are better.
        score: G, shape (n, m, m), to scores, shape (n,); minus infinity for layouts that tell nothing.
        slope: G, shape (m, m), to the derivative of the score, shape (m, m); None where the score is not concave.
        top: score that no G exceeds.
        figure: scores to figures that an engineer can read, smaller ones better.
        smooth: whether the slope is a derivative and not only one of many.
    """

    name: str
    measure: str
    score: Callable[[Array], Array]
    slope: Callable[[Array], Array] | None
    figure: Callable[[Array], Array]
    smooth: bool = True
    top: float = np.inf


def _log_det(G: Array) -> Array:
    sign, value = np.linalg.slogdet(G)
    return np.where(sign > 0, value / G.shape[-1], -np.inf)


def _trace(G: Array) -> Array:
    e = np.linalg.eigvalsh(G)
    seen = e[:, 0] > SINGULAR * e[:, -1]
    return np.where(seen, -np.mean(1 / np.where(seen[:, None], e, 1.0), axis=1), -np.inf)


def _trace_slope(G: Array) -> Array:
    inverse = np.linalg.inv(G)
    return np.asarray(inverse @ inverse / G.shape[0])


def _weakest(G: Array) -> Array:
    return np.asarray(np.linalg.eigvalsh(G)[:, 0], dtype=np.float64)


def _weakest_slope(G: Array) -> Array:
    v = np.linalg.eigh(G)[1][:, 0]
    return np.outer(v, v)


def off_diagonal_mac(G: Array) -> Array:
    """Largest modal assurance criterion between two modes, from G = Φᵀ Φ, shape (n, m, m); one for an unseen mode.

    Source: Allemang and Brown (1982), Proc. IMAC 1, 110-116.
    """
    power = np.diagonal(G, axis1=1, axis2=2)
    product = power[:, :, None] * power[:, None, :]
    mac = np.where(product > 0, G**2 / np.where(product > 0, product, 1.0), 1.0)
    m = G.shape[-1]
    mac[:, range(m), range(m)] = np.where(power > 0, 0.0, 1.0)
    return np.asarray(np.max(mac, axis=(1, 2)))


def _faintest(G: Array) -> Array:
    return np.min(np.diagonal(G, axis1=1, axis2=2), axis=1)


def _faintest_slope(G: Array) -> Array:
    power = np.diag(G)
    return np.diag(np.eye(len(power))[int(np.argmin(power))])


def _root(variance: Array) -> Array:
    return np.sqrt(variance)


def _from_least(information: Array) -> Array:
    seen = information > 0
    return np.where(seen, 1 / np.sqrt(np.where(seen, information, 1.0)), np.inf)


CRITERIA = {
    each.name: each
    for each in (
        Criterion(
            "d",
            "geometric mean of the standard deviations of the modal coordinates",
            _log_det,
            lambda G: np.linalg.inv(G) / len(G),
            lambda score: np.exp(-score / 2),
        ),
        Criterion(
            "a",
            "root mean square of the standard deviations of the modal coordinates",
            _trace,
            _trace_slope,
            lambda score: _root(-score),
        ),
        Criterion(
            "e",
            "standard deviation of the worst combination of modal coordinates",
            _weakest,
            _weakest_slope,
            _from_least,
            smooth=False,
        ),
        Criterion(
            "mac",
            "largest MAC between two modes",
            lambda G: -off_diagonal_mac(G),
            None,
            lambda score: -score,
            top=0.0,
        ),
        Criterion(
            "visibility",
            "standard deviation of the amplitude of the faintest mode, were it alone",
            _faintest,
            _faintest_slope,
            _from_least,
            smooth=False,
        ),
    )
}
"""By name.

Source: Pukelsheim (1993), Optimal Design of Experiments, sections 6.2 to 6.4, for D, A and E.
"""
