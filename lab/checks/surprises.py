"""Which surprises of a channel are its own, and which the whole structure felt."""

from __future__ import annotations

from lab.checks.outliers import Outlier
from lab.checks.survey import Sheet

CERTAIN = 7.0
"""Ratio of a surprise that a Gaussian channel shows once in 10^11 samples: with a scale 10 % off, still less than one
channel in 1000 of a million samples."""

BLOWS = ("pulse", "impact")
NEAR = 4
"""Samples within which two channels answer one blow."""

SHARED = 6.5
"""Ratio from which on a surprise of another channel counts as an answer to the same blow."""


def own_surprises(sheet: Sheet, row: int, kind: str) -> list[Outlier]:
    """Surprises of one kind that only this channel shows.

    A blow is felt by all channels, or driven by an input. A channel alone in its record is judged by the shape of the
    surprise, and not at all where blows are expected.
    """
    chosen = [o for o in sheet.outliers[row] if o.kind == kind and o.ratio > CERTAIN]
    others = [i for i in range(len(sheet.channels)) if i != row]
    alone = not others
    if alone and sheet.record.kind in BLOWS:
        return []
    # A blow can make a force, a velocity or an acceleration jump, but no place.
    place = kind == "jump" and sheet.channels[row].quantity == "displacement"
    felt = [] if place else [o.sample for i in others for o in sheet.outliers[i] if o.ratio > SHARED]
    margin = CERTAIN**2 / 4
    # A level that wanders by itself cannot be told from one that jumps.
    alone = alone or kind == "jump"
    return [
        o
        for o in chosen
        if (o.lead > margin or not alone) and not any(abs(o.sample - k) <= NEAR for k in felt)
    ]
