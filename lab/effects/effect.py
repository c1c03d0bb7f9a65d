"""What an effect is: a physical cause at a place, with a size.

The same class hides a cause in a rig, to make data that have it, and lists the places where it could sit, to explain
data that may have it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

from identification.recording import Channel
from lab.effects.edits import law_of
from lab.effects.survey import Guess, Survey
from lab.errors import LabError, UnknownNameError
from lab.paths import ORDER
from lab.plant import Plant
from lab.rig import Rig
from lab.stages import ALL, Stage

EVERYWHERE = "*"
"""Location of a change by one common factor."""


@dataclass(frozen=True)
class Effect:
    """A cause at a place.

    Attributes:
        location: name of the spring, body, joint or channel; two of them joined by "|" for a pair.
    """

    cause: ClassVar[str] = ""
    units: ClassVar[dict[str, str]] = {}
    """Unit of every parameter."""
    positive: ClassVar[tuple[str, ...]] = ()
    """Parameters that are positive by nature; fits use their logarithm."""
    passive: ClassVar[tuple[str, ...]] = ()
    """Parameters that are positive by nature, too; fits start at zero and may pass it, but no name is given there."""
    grows: ClassVar[bool] = False
    """Whether it adds degrees of freedom: such causes come last, since all others are written in those of the rig."""
    location: str

    def apply(self, rig: Rig) -> Rig:
        """The rig that has the effect.

        Raises:
            UnknownNameError: the location does not exist.
            LabError: the size is impossible.
        """
        for name, value in self.parameters.items():
            if not math.isfinite(value):
                raise LabError(
                    f"{self.cause} at {self.location!r}: {name} is {value}; expected a finite number"
                )
        return self.hide(rig)

    def hide(self, rig: Rig) -> Rig:
        """What `apply` does with numbers that are finite."""
        raise NotImplementedError

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        """The plant that has the effect: the same change as `apply`, on the rig's fast twin."""
        raise NotImplementedError

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every location where the effect could sit in this rig."""
        raise NotImplementedError

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        """Where fits of the effect at a location start; none for a parameter that the model has already."""
        return []

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the effect's parameters, as in the catalogue of causes."""
        return tuple(name for name in cls.units)

    @classmethod
    def of(cls, location: str, values: Mapping[str, Any]) -> Effect:
        """The effect whose fitted variables, those of `guesses`, have the values given."""
        return cls(location, **values)

    @property
    def parameters(self) -> dict[str, float]:
        """Value of every parameter that is set."""
        values = {name: getattr(self, name) for name in self.parameter_names()}
        return {name: value for name, value in values.items() if value is not None}

    def to_data(self) -> dict[str, Any]:
        """Plain data for JSON and TOML."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {"cause": self.cause, **{name: value for name, value in values.items() if value is not None}}

    def require(self, name: str, known: Sequence[str], what: str) -> None:
        """Check that a name in the location exists.

        Raises:
            UnknownNameError: it does not.
        """
        if name not in known:
            raise UnknownNameError(
                f"{self.cause} at {self.location!r}: there is no {what} {name!r}; there are {', '.join(known) or 'none'}"
            )

    def require_positive(self, *names: str) -> None:
        """Check that parameters are positive.

        Raises:
            LabError: one is not.
        """
        for name in names:
            if not 0 < getattr(self, name) < math.inf:
                raise LabError(
                    f"{self.cause} at {self.location!r}: {name} is {getattr(self, name)}; expected a positive number"
                )


class AtSpring:
    """Sits in a joint or tendon with stiffness or damping."""

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every spring."""
        return tuple(spring.name for spring in rig.springs)


class AtStiffness(AtSpring):
    """Sits in a spring that has stiffness, not in a mere damper."""

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every spring with stiffness."""
        return tuple(spring.name for spring in rig.springs if any(law_of(rig, spring)[0]))


class AtDamping(AtSpring):
    """Sits in a spring that has damping."""

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every spring with damping."""
        return tuple(spring.name for spring in rig.springs if any(law_of(rig, spring)[1]))


class AtBody:
    """Sits on a body that can move."""

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every body that can move."""
        return rig.bodies


class AtOutput:
    """Sits in an output channel."""

    def with_stage(self: Any, rig: Rig, stage: Stage) -> Rig:
        """The rig with one more stage behind the sensor of the channel."""
        self.require(self.location, _names(rig.outputs), "output channel")
        return _with_stage(rig, "sensors", stage)

    def with_samples_through(self: Any, rig: Rig, stage: Stage) -> Rig:
        """The rig with one more stage that the samples of the channel pass first."""
        self.require(self.location, _names(rig.outputs), "output channel")
        return rig.with_chain(replace(rig.chain, acquisition=(stage, *rig.chain.acquisition)))

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every connected output channel."""
        return _names(rig.outputs)


class AtInput:
    """Sits in an input channel."""

    def with_stage(self: Any, rig: Rig, stage: Stage) -> Rig:
        """The rig with one more stage before the actuator of the channel."""
        self.require(self.location, _names(rig.inputs), "input channel")
        return _with_stage(rig, "actuators", stage)

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every connected input channel."""
        return _names(rig.inputs)


def pairs(names: Sequence[str]) -> tuple[str, ...]:
    """Every pair of names in their order, joined by "|"."""
    return tuple(f"{a}|{b}" for i, a in enumerate(names) for b in names[i + 1 :])


def _with_stage(rig: Rig, place: str, stage: Stage) -> Rig:
    """The rig with a stage put where it belongs among those of its channel, whichever comes first."""
    found, order = list(getattr(rig.chain, place)), ORDER[place]
    later = order[order.index(stage.name) + 1 :]
    behind = [i for i, s in enumerate(found) if s.name in later and s.channel in (stage.channel, ALL)]
    found.insert(min(behind, default=len(found)), stage)
    changed: dict[str, Any] = {place: tuple(found)}
    return rig.with_chain(replace(rig.chain, **changed))


def _names(channels: Sequence[Channel]) -> tuple[str, ...]:
    return tuple(channel.name for channel in channels)
