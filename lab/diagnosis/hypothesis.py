"""Hypothesis: a cause at a place, as far as a fit has come with its size."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification.recording import Array
from lab.effects.effect import Effect
from lab.effects.survey import Guess

FARTHEST = 8.0
"""A positive variable stays within e⁸ of its scale either way: beyond, it means nothing and only overflows."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A cause at a place, with fitted variables in units of a large step.

    Positive variables are fitted as logarithms, so that every step is possible.

    Attributes:
        kind: class of the effect.
        location: where it sits.
        guess: start and scale of its variables.
        values: where the fit stands, shape (n_variables,).
    """

    kind: type[Effect]
    location: str
    guess: Guess
    values: Array

    @classmethod
    def starting(cls, kind: type[Effect], location: str, guess: Guess) -> Hypothesis:
        """The hypothesis at its guess."""
        values = [
            np.log(guess.start[name] / scale) if name in kind.positive else guess.start[name] / scale
            for name, scale in guess.scale.items()
        ]
        return cls(kind, location, guess, np.array(values, dtype=float))

    @property
    def n(self) -> int:
        """Number of fitted variables."""
        return self.values.size

    @property
    def effect(self) -> Effect:
        """The effect at the present values."""
        values: dict[str, Any] = dict(self.guess.fixed or {})
        for (name, scale), value in zip(self.guess.scale.items(), self.values, strict=True):
            values[name] = scale * float(
                np.exp(np.clip(value, -FARTHEST, FARTHEST)) if name in self.kind.positive else value
            )
        return self.kind.of(self.location, values)

    def at(self, values: Array) -> Hypothesis:
        """The hypothesis at other values."""
        return replace(self, values=np.asarray(values, dtype=float))

    def __repr__(self) -> str:
        return f"{self.kind.cause}@{self.location}"
