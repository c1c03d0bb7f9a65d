"""Peaks of a spectrum that rise and fall by a factor, whatever ripples lie on them."""

from __future__ import annotations

from typing import NamedTuple

from identification.recording import Array


class Peak(NamedTuple):
    """One peak.

    Attributes:
        top: line of the highest value.
        fall: first line behind it where the spectrum has fallen by the factor.
    """

    top: int
    fall: int


def find_peaks(power: Array, factor: float, *, from_start: bool = False) -> list[Peak]:
    """Peaks that the spectrum rises to, and falls from, by more than a factor.

    Args:
        power: not negative, shape (n_lines,).
        factor: above one.
        from_start: take the first line for the foot of a rise already under way.

    Returns:
        By rising line.
    """
    found: list[Peak] = []
    top, low, climbing = 0, float("inf"), from_start
    for k, value in enumerate(power.tolist()):
        if climbing and value > power[top]:
            top = k
        elif climbing and value * factor < power[top]:
            found.append(Peak(top, k))
            low, climbing = value, False
        elif not climbing and value > factor * low:
            top, climbing = k, True
        elif not climbing:
            low = min(low, value)
    return found
