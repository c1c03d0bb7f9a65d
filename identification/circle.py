"""The unit circle on which a band of frequency lines is laid out, so that polynomials can be fitted to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array
from identification.response import FrequencyResponse

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Circle:
    """How the lines from `low` to `high` [Hz] lie on the upper half of the unit circle.

    Attributes:
        dt: sample time of the response [s], zero where it is continuous.
        low, high: ends of the upper half.
    """

    dt: float
    low: float
    high: float

    @property
    def T(self) -> float:
        """Time [s] by which z = exp(sT) turns over half the circle within the band."""
        return 0.5 / (self.high - self.low)

    @property
    def whole(self) -> bool:
        """Whether the circle is that of the sample time."""
        return self.low == 0 and self.high * self.dt == 0.5

    def points(self, frequency_hz: Array) -> Complex:
        """Where lines [Hz] lie on the circle."""
        return np.asarray(np.exp(2j * np.pi * (frequency_hz - self.low) * self.T))

    def poles(self, z: Complex) -> Complex:
        """Poles of the model that the zeros z on this circle stand for; real ones do not oscillate."""
        if self.whole:
            return z
        oscillates = z.imag != 0
        s = np.log(np.where(oscillates, z, np.abs(z))) / self.T + 2j * np.pi * self.low * oscillates
        return np.asarray(np.exp(s * self.dt) if self.dt else s, dtype=np.complex128)

    def decaying(self, poles: Complex) -> NDArray[np.bool_]:
        """Whether each pole of the model decays."""
        return np.asarray(np.abs(poles) < 1 if self.dt else poles.real < 0)


def all_lines(response: FrequencyResponse) -> tuple[float, float]:
    """Band of a circle for all lines: up to half the sample rate, or to the last line where time is continuous.

    Args:
        response: with its lines.

    Returns:
        Lowest and highest frequency [Hz].
    """
    if response.dt:
        return 0.0, 0.5 / response.dt
    return float(response.frequency_hz[0]), float(response.frequency_hz[-1])


def model_points(response: FrequencyResponse) -> Complex:
    """Where the lines lie in the plane of the model's poles: z = exp(2πi f dt), or s = 2πi f.

    Args:
        response: sampled, or continuous in time.

    Returns:
        Shape (n_lines,).
    """
    s = 2j * np.pi * response.frequency_hz
    return np.asarray(np.exp(s * response.dt) if response.dt else s, dtype=np.complex128)
