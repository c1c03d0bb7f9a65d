"""Places: whether a further cause would sit where one was found already, and only mend its law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.recording import Array
from lab.diagnosis.hypothesis import Hypothesis
from lab.effects.effect import EVERYWHERE, Effect
from lab.effects.survey import Survey

LINEAR = ("mass_change", "stiffness_change", "damping_change")
"""Changes of what the model has already; several of them may well strike one place."""
RESOLUTION = 2.0
"""Tones closer than so many over the length of the record come from one source."""


def mends(
    kind: type[Effect], location: str, found: Sequence[tuple[type[Effect], str]], survey: Survey
) -> bool:
    """Whether a cause at a place would only mend the law of one that was found there.

    Real friction is not quite Coulomb's nor real drag quite quadratic. What is left of one defect at its place is taken up
    by any other cause there, and two defects in one place are far less likely than one with a law of its own.
    """
    return any(
        not (kind.cause in LINEAR and other.cause in LINEAR) and _same(location, there, survey)
        for other, there in found
    )


def echoes(hypothesis: Hypothesis, found: Sequence[Hypothesis], survey: Survey) -> bool:
    """Whether a tone has the frequency of one that was found."""
    frequency = tone(hypothesis)
    return frequency is not None and any(
        other is not None and abs(frequency - other) < RESOLUTION / survey.duration
        for other in map(tone, found)
    )


def tone(hypothesis: Hypothesis) -> float | None:
    """Frequency of a tone [Hz]; None for any other cause."""
    effect = hypothesis.effect
    if effect.cause not in ("line_hum", "unmeasured_force"):
        return None
    frequency = effect.parameters.get("frequency_hz")
    return None if frequency is None else float(frequency)


def _same(a: str, b: str, survey: Survey) -> bool:
    """Whether two names stand for one place: they are equal, or a joint and a spring that extend alike."""
    if EVERYWHERE in (a, b):
        return False
    if a == b:
        return True
    rows = [_row(name, survey) for name in (a, b)]
    if any(row is None for row in rows):
        return False
    u, v = (row / np.linalg.norm(row) for row in rows if row is not None)
    return bool(abs(u @ v) > 1 - 1e-9)


def _row(name: str, survey: Survey) -> Array | None:
    known = (*survey.twin.springs, *survey.rig.dofs)
    row = survey.row(name) if name in known else None
    return row if row is not None and np.any(row) else None
