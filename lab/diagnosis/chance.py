"""Chance: how much evidence the luckiest of many causes gains where nothing is hidden."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.special

from identification.recording import Array

DRAWS = 32
LEVEL = 1e-3
"""Probability that a search names a cause where there is none."""
NO_CHANCE = np.full(DRAWS, -np.inf)
"""Gain of a cause without variables, which noise never takes for true."""


class Chance:
    """Parametric bootstrap of the calibrated model: what every cause gains when the residual is replaced by noise.

    Near the calibrated model a cause acts on the residual through its slopes, and the likelihood it gains from noise is what
    its slopes can explain of the noise. All causes see the same draws, so that their likeness counts: a thousand
    causes that act alike are one look, not a thousand.
    """

    def __init__(self, shape: tuple[int, int], n_total: int) -> None:
        """Draws of noise.

        Args:
            shape: of the residual, (n_outputs, n).
            n_total: numbers in the residual that decides, whose logarithm every variable costs.
        """
        self.noise = np.random.default_rng(0).standard_normal((DRAWS, *shape))
        self.price = float(np.log(n_total))

    def gains(self, slopes: Array) -> Array:
        """2 log evidence that a cause gains from each draw, (n_draws,), less what its variables cost.

        Args:
            slopes: of the residual by the cause's variables, in units of the noise, with what the model's parameters can
                explain projected out, (n_variables, n_outputs, n).
        """
        A = slopes.reshape(len(slopes), -1)
        matches = A @ self.noise.reshape(DRAWS, -1).T
        explained = np.linalg.lstsq(A @ A.T, matches, rcond=1e-10)[0]
        return np.asarray(np.sum(matches * explained, axis=0) - len(slopes) * self.price)

    @cached_property
    def tones(self) -> Array:
        """The same for the strongest tone of each draw, whose frequency is chosen from the spectrum, (n_draws,)."""
        n = self.noise.shape[2]
        power = 2 * np.abs(np.fft.rfft(self.noise, axis=2)[..., 1:-1]) ** 2 / n
        return np.asarray(np.max(power, axis=(1, 2)) - 3 * self.price)


def quantile(best: Array, own: int) -> float:
    """2 log evidence that the luckiest of all looks exceeds with a probability of `LEVEL` only.

    The largest of many chance gains follows Gumbel's law, fitted by its moments since so rare a quantile cannot be counted.
    The model's own parameters are looked at besides: the one farthest from its nominal value is held against the spread of
    all, which is estimated with it (Student's t; Bonferroni).

    Args:
        best: gain of the luckiest cause in each draw, (n_draws,); -inf where no cause was looked at.
        own: number of the model's own parameters.
    """
    of_causes = 0.0
    if np.all(np.isfinite(best)):
        scale = np.std(best, ddof=1) * np.sqrt(6) / np.pi
        of_causes = np.mean(best) - scale * (np.euler_gamma + np.log(-np.log1p(-LEVEL)))
    if own < 1:
        return float(max(of_causes, 0.0))
    # The likelihood ratio of one outlier among n + 1 normal numbers whose spread is unknown is (n + 1) log(1 + t² / n). What is
    # believed of the spread beforehand, a factor of two either way, counts as about one of them.
    t_squared = scipy.special.fdtri(1, own, 1 - LEVEL / own)
    return float(max(of_causes, (own + 1) * np.log1p(t_squared / own), 0.0))
