"""Experiment: what data in the frequency domain must offer to be diagnosed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from identification.recording import Array
from lab.diagnosis.outcome import SpectralPrediction
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.spectral.tones import FoundTone
from lab.diagnosis.spectral.transfer import Complex
from lab.effects.effect import Effect
from lab.rig import Rig
from lab.twin import Twin


class Experiment(Protocol):
    """Data with a part kept out of every fit. Its likelihoods are its own kind of `Likelihood`."""

    @property
    def visible(self) -> tuple[str, ...]:
        """Causes that show in such data."""
        ...

    def likelihood(self, twin: Twin, parameters: Parameters, rig: Rig) -> Any:
        """The likelihood of the training data."""
        ...

    def surveyed(self, likelihood: Any, nuisance: Array) -> Any:
        """The likelihood that knows how strongly the structure moves at a fit."""
        ...

    def weighted(self, likelihood: Any, predicted: Complex) -> Experiment:
        """The data with errors spread as a fit leaves them; the same object where the data say how they are."""
        ...

    def lesson_of(self, likelihood: Any, predicted: Complex) -> Any | None:
        """How the model errs in these data; None where that is not asked for."""
        ...

    def after(self, lesson: Any | None) -> Experiment:
        """The data seen by one who knows how the model errs where nothing is wrong."""
        ...

    def in_parts(self, likelihood: Any) -> Any | None:
        """The likelihood of consecutive parts, in which drift shows; None where there can be none."""
        ...

    def held_out(self, likelihood: Any) -> Any:
        """The likelihood of the data that no fit has seen."""
        ...

    def error(self, held_out: Any, predicted: Complex) -> float:
        """Relative error of a prediction."""
        ...

    def floor(self, held_out: Any, predicted: Complex) -> float:
        """The error that a true model has."""
        ...

    def left(self, likelihood: Any, predicted: Complex) -> str:
        """Where something is left that chance does not explain, in a sentence; empty where nothing is."""
        ...

    def tones(
        self, likelihood: Any, found: Any, effects: Mapping[str, type[Effect]]
    ) -> tuple[list[FoundTone], int]:
        """Tones, best first, and at how many places they were looked for."""
        ...

    def without(self, tone: FoundTone) -> Experiment:
        """The data with a tone taken out."""
        ...

    def again(self, likelihood: Any) -> Any:
        """The same likelihood of the data as they are now."""
        ...

    def shown(self, held_out: Any, predicted: tuple[Complex, Complex, Complex]) -> SpectralPrediction:
        """Held-out data and the predictions of three models."""
        ...

    def warnings(self, likelihood: Any, nominal: Any) -> list[str]:
        """What these data cannot tell."""
        ...
