"""Screening: every cause at every place, tried cheaply, and what the luckiest would have gained from noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.diagnosis.chance import NO_CHANCE
from lab.diagnosis.glance import Glance, Look
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.misfit import Misfit
from lab.effects.effect import Effect
from lab.hands import shared

SCREEN_SAMPLES = 4096
SCREEN_SUBSTEPS = 3
"""Enough to rank causes by, where nothing else in the model has a law."""
STEPPED_ON, PLACES = 40, 8
"""Hypotheses that get more than one step in the screening; and places at which each cause does that begins at some size: it may
begin far off, and would not show beside causes that begin at none."""
AT_ONCE = 16
"""Hypotheses that are looked at in one piece of work."""
QUIET = 0.5
"""Power of the head of a record over that of the whole below which it tells too little: an impact may come late."""
SCREEN_VALUES = 32768
"""Samples of all outputs together that are enough to rank causes by."""


@dataclass(frozen=True, eq=False)
class Screened:
    """Score of one hypothesis after a few steps from `theta` with the model's parameters projected out."""

    hypothesis: Hypothesis
    theta: Array
    score: float


@dataclass(frozen=True, eq=False)
class Screening:
    """What screening tells.

    Attributes:
        rows: hypotheses by falling score: the likelihood gained in a few steps, less the price of their variables.
        lucky: the best score that each of many draws of mere noise would have given.
        base: -2 log posterior that scores are counted from.
    """

    rows: list[Screened]
    lucky: Array
    base: float

    def beside(self, other: Screening) -> Screening:
        """Both, all scores counted from this one's base."""
        moved = [replace(row, score=row.score + self.base - other.base) for row in other.rows]
        return replace(self, rows=sorted(self.rows + moved, key=lambda row: -row.score))


def coarsely(misfit: Misfit, theta: Array, present: Sequence[Hypothesis]) -> Misfit:
    """The misfit with fewer substeps, enough to rank causes by; as it is where a law is present already."""
    return misfit if misfit.plant(theta, present).laws else replace(misfit, substeps=SCREEN_SUBSTEPS)


def enough_samples(misfit: Misfit, share: float = 1.0) -> tuple[int, ...]:
    """Training samples of each record that are enough to rank causes by, or a share of them; all where its head is quiet."""
    most = int(share * min(SCREEN_SAMPLES, SCREEN_VALUES // misfit.measured.shape[0]))
    found = []
    for (_, measured), n in zip(misfit.records, misfit.n_train, strict=True):
        power = [np.nansum(measured[:, :k] ** 2, axis=1) / k for k in (min(n, most), n)]
        quiet = np.median(power[0] / np.maximum(power[1], 1e-300)) < QUIET
        found.append(n if quiet else min(n, most))
    return tuple(found)


def hypotheses(misfit: Misfit, effects: Mapping[str, type[Effect]]) -> list[Hypothesis]:
    """Every cause at every place from every starting value."""
    survey = misfit.survey
    assert survey is not None
    return [
        Hypothesis.starting(kind, location, guess)
        for kind in effects.values()
        for location in kind.places(survey.rig)
        for guess in kind.guesses(survey, location)
        # A place that the test does not move has no scale.
        if all(0 < abs(scale) < np.inf for scale in guess.scale.values())
    ]


def screen(
    misfit: Misfit,
    theta: Array,
    present: Sequence[Hypothesis],
    observer: Array,
    proposed: Sequence[Hypothesis],
    work: Work = UNHEARD,
    *,
    share: float = 1.0,
    places: int = PLACES,
) -> Screening:
    """Every hypothesis tried cheaply beside the causes present, and what the luckiest would have gained from noise.

    Args:
        misfit: model and data.
        theta: parameters of the model.
        present: causes so far.
        observer: gain that pulls the state to the measurements.
        proposed: causes to try.
        work: told of every hypothesis.
        share: of the samples that are usually looked at.
        places: where each cause that begins at some size is followed, besides the best of all.
    """
    n_train = enough_samples(misfit, share)
    glance = Glance.beside(coarsely(misfit, theta, present), theta, tuple(present), observer, n_train)
    looking, following = work.parts(len(proposed), 2 * STEPPED_ON)
    pieces = [proposed[i : i + AT_ONCE] for i in range(0, len(proposed), AT_ONCE)]
    looks = [look for some in looking.each(shared(glance.looks, pieces), len(pieces)) for look in some]
    lucky = np.max([NO_CHANCE, *(each for _, each in looks)], axis=0)
    first = sorted((look for look, _ in looks), key=lambda look: -glance.score(look))
    chosen = _to_follow(first, places)
    few = [chosen[i : i + AT_ONCE // 4] for i in range(0, len(chosen), AT_ONCE // 4)]
    followed = following.each(shared(glance.followed, few), len(few))
    again = [look for some in followed for look in some]
    known = {id(look) for look in chosen}
    rows = [
        Screened(look[0], theta, glance.score(look))
        for look in again + [look for look in first if id(look) not in known]
    ]
    return Screening(sorted(rows, key=lambda row: -row.score), lucky, glance.base)


def _to_follow(looks: Sequence[Look], places: int) -> list[Look]:
    """The best of all, and the best of those that begin at some size at their places, of looks by falling score."""
    followed: dict[str, set[str]] = {}
    chosen = []
    for number, look in enumerate(looks):
        h = look[0]
        known = followed.setdefault(h.kind.cause, set())
        sized = any(h.guess.start.values()) and h.location not in known and len(known) < places
        if number < STEPPED_ON or sized:
            chosen.append(look)
            known.add(h.location)
    return chosen
