"""Plausible: what a fitted cause must be beyond likely, to deserve its name."""

from __future__ import annotations

from lab.diagnosis.hypothesis import Hypothesis

NEVER = 30.0
"""Yield displacement, in RMS travels of the spring, at which it is a plain spring in all but name."""


def plausible(cause: Hypothesis, band_hz: tuple[float, float]) -> bool:
    """Whether a cause is what its name says: a spring holds, drag brakes, an oscillator oscillates where data reach.

    One that resonates far above the band only adds its mass, one far below only a spring to the ground; overdamped it is a
    damper. A spring with a memory that would yield far beyond where it goes is a stiffer spring. Each of these has a name of
    its own. A spring that is missing does not push apart, nor does drag drive: where a fit wants that, something else is at
    work.

    Args:
        cause: at its fitted values.
        band_hz: lowest and highest frequency of the data.
    """
    values = cause.effect.parameters
    if any(values[name] < 0 for name in cause.kind.passive):
        return False
    if cause.kind.cause == "hysteresis":
        return bool(values["yield_displacement"] < NEVER * cause.guess.scale["yield_displacement"])
    if cause.kind.cause != "attached_oscillator":
        return True
    low, high = band_hz
    return low <= values["frequency_hz"] <= high and values["damping_ratio"] < 1
