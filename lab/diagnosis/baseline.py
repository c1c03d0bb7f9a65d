"""Baseline: what a known state teaches about the errors of the model itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.special

from identification.recording import Array
from lab.diagnosis.calibrate import Calibration
from lab.diagnosis.colour import colour
from lab.diagnosis.fit import Fit, fit
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.misfit import Misfit

LEVEL = 1e-3
"""Probability that as little as a baseline leaves is taken for more."""
SHARED = 0.5
"""Share of what a cause explains per sample that it must explain of the baseline to have been there before."""


@dataclass(frozen=True, eq=False)
class Baseline:
    """A model calibrated on a known state, and what that leaves.

    Attributes:
        misfit: model and data of the known state.
        fit: parameters with error bars that know how alike the errors are.
        power: residual over signal power of every output.
        colour: samples of the residual that count as one.
        samples: of the residual, counted so.
        gains: relative standard deviation of the gain of each input that is not known exactly, by name of the input.
    """

    misfit: Misfit
    fit: Fit
    power: Array
    colour: float
    samples: float
    gains: Mapping[str, float]

    @classmethod
    def of(cls, calibration: Calibration) -> Baseline:
        """The baseline of a model calibrated on a recording of the known state."""
        residual = calibration.fit.residual
        alike = colour(residual)
        coloured = replace(calibration.misfit, colour=alike)
        found = fit(coloured, calibration.fit.theta, iterations=2)
        parameters, stds = coloured.parameters, np.sqrt(np.diag(found.covariance))
        gains = {
            parameters.names[i].partition(" ")[2]: float(parameters.widths[i] * stds[i])
            for i in range(parameters.n_structural, parameters.n_factors)
        }
        return cls(coloured, found, _power(coloured, found), alike, residual.shape[1] / alike, gains)

    def covers(self, misfit: Misfit, found: Fit) -> bool:
        """Whether a fit of another recording leaves no more of its signals than the baseline of its own.

        Errors of the model grow with the signal, so shares are compared, by an F-test (Bonferroni over outputs).
        """
        power = _power(misfit, found)
        samples = max(found.residual.shape[1] / self.colour, 1.0)
        limit = scipy.special.fdtri(samples, max(self.samples, 1.0), 1 - LEVEL / power.size)
        return bool(np.all(power <= limit * self.power))

    def shows(self, cause: Hypothesis, gain: float, samples: float) -> bool:
        """Whether a cause was there before: it explains at least half as much of the baseline, sample by sample.

        Args:
            cause: as fitted to another recording.
            gain: 2 log evidence that it gains there.
            samples: of that recording, counted as those of the baseline.
        """
        before = fit(self.misfit, self.fit.theta, (cause,), iterations=8)
        return bool((self.fit.objective - before.objective) / self.samples >= SHARED * gain / samples)


def _power(misfit: Misfit, found: Fit) -> Array:
    return np.asarray(
        np.mean(misfit.made_whole(found.residual) ** 2, axis=1) / np.nanmean(misfit.measured**2, axis=1)
    )
