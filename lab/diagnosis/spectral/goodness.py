"""Goodness: whether averaged cross-spectra are explained, by tests that are exact for Gaussian signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.stats

from identification.recording import Array
from lab.diagnosis.spectral.ambient import Ambient
from lab.diagnosis.spectral.lines import Complex

LEVEL = 1e-3
"""Probability that a true model fails."""
ENOUGH = 60.0
"""Independent lines in a test, in units of the number of channels."""


@dataclass(frozen=True)
class Goodness:
    """The least likely of all powers and coherences that a true model would leave.

    Attributes:
        probability: that a true model leaves one as unlikely, all tests counted.
        channels: outputs that it concerns, one or two.
        band: lowest and highest frequency of it [Hz].
        ratio: measured over predicted power where one channel is concerned, coherence left where two are.
    """

    probability: float
    channels: tuple[int, ...]
    band: tuple[float, float]
    ratio: float

    @property
    def passed(self) -> bool:
        """Whether what is left passes for chance."""
        return self.probability >= LEVEL


def goodness(likelihood: Ambient, predicted: Complex) -> Goodness:
    """Test of L⁻¹ Ŝ L⁻ᴴ, averaged over wider and wider bands, against the identity.

    Its diagonal is Gamma distributed with shape ν, and each squared coherence exceeds c with probability (1 - c)^(ν - 1).

    Source: Goodman (1957), New York University report EM-366; Brillinger (1981), Time Series, 7.3 and 8.5.
    """
    Z = likelihood.normalized(predicted)
    least, found, tests = np.inf, Goodness(1.0, (0,), (0.0, 0.0), 1.0), 0
    bands = likelihood.data[0].bands
    for part, counts in zip(Z, likelihood.counts, strict=True):
        for size in (ENOUGH * Z.shape[-1], 4 * ENOUGH * Z.shape[-1]):
            groups = grouped(counts, size)
            means, n = averaged(part, counts, groups)
            log_p, ratio = _probabilities(means, n)
            tests += int(np.sum(np.isfinite(log_p)))
            k, i, j = np.unravel_index(np.argmin(log_p), log_p.shape)
            if log_p[k, i, j] < least:
                least = float(log_p[k, i, j])
                edges = bands.frequency_hz[[groups[k], (*groups, counts.size)[k + 1] - 1]]
                channels = (int(i),) if i == j else (int(min(i, j)), int(max(i, j)))
                found = Goodness(1.0, channels, (float(edges[0]), float(edges[1])), float(ratio[k, i, j]))
    # log1p(-(1 - p)^tests) without losing small p
    total = float(-np.expm1(tests * np.log1p(-min(np.exp(least), 1 - 1e-16))))
    return Goodness(total, found.channels, found.band, found.ratio)


def grouped(counts: Array, size: float) -> tuple[int, ...]:
    """Starts of groups of neighbouring bands with at least that many lines each (one group where there are fewer)."""
    starts, have = [0], 0.0
    rest = float(np.sum(counts))
    for i, n in enumerate(counts):
        if have >= size and rest >= size:
            starts.append(i)
            have = 0.0
        have += n
        rest -= n
    return tuple(starts)


def averaged(Z: Complex, counts: Array, groups: tuple[int, ...]) -> tuple[Complex, Array]:
    """Means of Z over groups of bands, (n_groups, n, n), and the lines in each."""
    total = np.add.reduceat(counts, groups)
    sums = np.add.reduceat(Z * counts[:, None, None], groups, axis=0)
    return np.asarray(sums / total[:, None, None]), total


def _probabilities(means: Complex, n: Array) -> tuple[Array, Array]:
    """Log probability of each entry (infinite below the diagonal, which says nothing new), and what was measured."""
    power = np.diagonal(means, axis1=1, axis2=2).real
    shape = np.broadcast_to(n[:, None], power.shape)
    tail = np.minimum(
        scipy.stats.gamma.logsf(power * shape, shape), scipy.stats.gamma.logcdf(power * shape, shape)
    )
    coherence = np.abs(means) ** 2 / (power[:, :, None] * power[:, None, :])
    size = means.shape[-1]
    log_p = (n[:, None, None] - 1) * np.log1p(-np.minimum(coherence, 1 - 1e-15))
    log_p[:, np.tril_indices(size)[0], np.tril_indices(size)[1]] = np.inf
    log_p[:, range(size), range(size)] = tail + np.log(2)
    coherence[:, range(size), range(size)] = power
    return log_p, coherence
