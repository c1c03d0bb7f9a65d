"""Survey: what is known about a rig and its data when causes are proposed, and where a fit may start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from identification.recording import Array
from lab.errors import UnknownNameError
from lab.rig import Rig
from lab.twin import Twin


@dataclass(frozen=True)
class Guess:
    """Where a fit of a cause starts, and how large a step is a large one.

    Attributes:
        start: value of every fitted parameter.
        scale: size that changes the response noticeably, for each.
        fixed: parameters that are part of the hypothesis and are not fitted.
    """

    start: Mapping[str, float]
    scale: Mapping[str, float]
    fixed: Mapping[str, float | str] | None = None


@dataclass(frozen=True, eq=False)
class Survey:
    """A rig, its twin, and how strongly the test moves it.

    Attributes:
        rig: as the engineer believes it to be.
        twin: its arrays.
        covariance: of displacements, (n_dofs, n_dofs) [m^2].
        speed_covariance: of velocities, (n_dofs, n_dofs) [m^2/s^2].
        force_rms: RMS inertia force on each degree of freedom [N].
        output_rms, output_peak: of each recorded output.
        input_rms, input_peak: of each recorded input; peaks are those that fits see.
        tones: for each output, frequencies [Hz] at which the residual stands out.
        common_tones: frequencies at which all residuals stand out together.
        dt: sample time [s].
        duration: of the longest record [s].
    """

    rig: Rig
    twin: Twin
    covariance: Array
    speed_covariance: Array
    force_rms: Array
    output_rms: Array
    output_peak: Array
    input_rms: Array
    input_peak: Array
    tones: tuple[tuple[float, ...], ...]
    common_tones: tuple[float, ...]
    dt: float
    duration: float

    def row(self, location: str) -> Array:
        """Extension per displacement of a spring or joint."""
        if location in self.twin.springs:
            return self.twin.rows[self.twin.springs.index(location)]
        if location in self.rig.dofs:
            return np.eye(len(self.rig.dofs))[self.rig.dofs.index(location)]
        raise UnknownNameError(
            f"there is no spring or joint {location!r}; there are {', '.join(self.twin.springs)}"
        )

    def spring(self, location: str) -> int:
        """Number of a spring."""
        return self.twin.springs.index(location)

    def body(self, location: str) -> int:
        """Number of a body."""
        return self.twin.bodies.index(location)

    def output(self, location: str) -> int:
        """Number of an output channel."""
        return [channel.name for channel in self.rig.outputs].index(location)

    def input(self, location: str) -> int:
        """Number of an input channel."""
        return [channel.name for channel in self.rig.inputs].index(location)

    def travel(self, row: Array) -> float:
        """RMS extension along a row [m]."""
        return float(np.sqrt(row @ self.covariance @ row))

    def speed(self, row: Array) -> float:
        """RMS rate of extension along a row [m/s]."""
        return float(np.sqrt(row @ self.speed_covariance @ row))

    def push(self, row: Array) -> float:
        """A force [N] along a row that changes its motion noticeably: the inertia force of what it moves."""
        moved = np.abs(row) > 1e-9 * np.max(np.abs(row))
        return float(np.min(self.force_rms[moved]))

    @property
    def middle_frequency(self) -> float:
        """Median natural frequency of the structure [Hz]."""
        return float(np.median(self.rig.second_order().modes().frequency_hz))
