"""Plausible: what a fitted cause must be beyond likely, to deserve its name."""

from __future__ import annotations

from lab.diagnosis.misfit import Hypothesis


def plausible(cause: Hypothesis, band_hz: tuple[float, float]) -> bool:
    """Whether a cause is what its name says: an oscillator oscillates, and at a frequency that the data reach.

    One that resonates far above the band only adds its mass, one far below only a spring to the ground; overdamped it is a
    damper. Each of these has a name of its own.

    Args:
        cause: at its fitted values.
        band_hz: lowest and highest frequency of the data.
    """
    if cause.kind.cause != "attached_oscillator":
        return True
    values = cause.effect.parameters
    low, high = band_hz
    return low <= values["frequency_hz"] <= high and values["damping_ratio"] < 1
