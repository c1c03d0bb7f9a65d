"""State: how far a diagnosis has come."""

from __future__ import annotations

from dataclasses import dataclass

from lab.diagnosis.calibrate import Calibration
from lab.diagnosis.candidate import Candidate
from lab.diagnosis.fit import Fit
from lab.diagnosis.misfit import Misfit


@dataclass(frozen=True, eq=False)
class State:
    """How far a diagnosis has come.

    Attributes:
        calibration: model and data, and where the search for the next cause starts.
        fit: parameters and causes so far.
        accepted: causes so far.
        origin: the calibration without any cause.
        held_out: error on data kept aside, of the calibrated model and after each cause.
    """

    calibration: Calibration
    fit: Fit
    accepted: tuple[Candidate, ...]
    origin: Fit
    held_out: tuple[float, ...]

    @property
    def misfit(self) -> Misfit:
        """Model and data."""
        return self.calibration.misfit
