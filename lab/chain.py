"""Measurement chain: what actuators, sensors and data acquisition do to the signals between desk and structure.

A chain is a list of stages in each of four places, in the order in which the signal passes them:

    command -> actuators -> force on the structure -> motion -> sensors -> acquisition -> recorded output
                                 `-> force_sensors -> recorded input

Stages of `actuators` see forces at every substep of the simulation, shape (3, n): at its start, on average (which is what
acts), and at its end. Stages of `sensors` see the signal at every instant between substeps, shape (3, n): as the substep
before it ends, as the substep after it starts, both under the mean force of that substep, and at the instant itself.
Stages of `force_sensors` and `acquisition` see samples, shape (n,). The default chain is ideal: it has no stage, and the
recorded input is the commanded force.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from lab.errors import RigError, UnknownNameError
from lab.stages import ALL, STAGES, Stage

PLACES = {
    "actuators": "input channel",
    "disturbances": "degree of freedom",
    "sensors": "output channel",
    "force_sensors": "input channel",
    "acquisition": "output channel",
}
"""Where stages sit, and what the name of a stage stands for there."""


@dataclass(frozen=True, repr=False)
class Chain:
    """What lies between the recorded inputs, the structure and the recorded outputs.

    Attributes:
        inputs: names of the connected input channels; None for all.
        outputs: names of the connected output channels; None for all.
        swaps: pairs of output channels whose cables are exchanged.
        actuators: stages from commanded to applied force.
        disturbances: what adds to the unmeasured force on a degree of freedom, named as channel.
        sensors: stages from motion to signal.
        force_sensors: stages on the measured force.
        force_measured: the recorded input is the force that acted, as force sensors saw it, not the commanded one.
        acquisition: stages on the sampled outputs.
    """

    inputs: tuple[str, ...] | None = None
    outputs: tuple[str, ...] | None = None
    swaps: tuple[tuple[str, str], ...] = ()
    actuators: tuple[Stage, ...] = ()
    disturbances: tuple[Stage, ...] = ()
    sensors: tuple[Stage, ...] = ()
    force_sensors: tuple[Stage, ...] = ()
    force_measured: bool = False
    acquisition: tuple[Stage, ...] = ()

    def adding(self, place: str, *stages: Stage) -> Chain:
        """The chain with stages appended in one place: actuators, sensors, force_sensors or acquisition."""
        changed: dict[str, Any] = {place: (*getattr(self, place), *stages)}
        return dataclasses.replace(self, **changed)

    @property
    def whole_record(self) -> bool:
        """Whether a stage must see a record from its start to its end at once."""
        return any(stage.whole_record for place in PLACES for stage in getattr(self, place))

    def check(self, inputs: Sequence[str], outputs: Sequence[str], dofs: Sequence[str]) -> None:
        """Check every name of a channel or degree of freedom against those that exist.

        Raises:
            UnknownNameError: a name does not exist.
            RigError: a stage sits where it cannot act, or only one of two swapped channels is connected.
        """
        wanted = [("input channel", name, inputs) for name in self.inputs or ()]
        wanted += [("output channel", name, outputs) for name in (self.outputs or ())]
        wanted += [("output channel", name, outputs) for pair in self.swaps for name in pair]
        exist = {"input channel": inputs, "output channel": outputs, "degree of freedom": dofs}
        for place, side in PLACES.items():
            used = [stage.channel for stage in getattr(self, place) if stage.channel != ALL]
            wanted += [(side, name, exist[side]) for name in used]
        for place in PLACES:
            between = place in ("actuators", "sensors")
            for stage in getattr(self, place):
                if stage.needs_substeps and not between:
                    raise RigError(
                        f"stage {stage.name!r} cannot act on samples in {place!r}; put it among the actuators or sensors"
                    )
                if stage.needs_samples and between:
                    raise RigError(
                        f"stage {stage.name!r} acts on samples only, not in {place!r}; put it in 'acquisition' or "
                        "'force_sensors'"
                    )
        for side, name, names in wanted:
            if name not in names:
                raise UnknownNameError(
                    f"{side} {name!r} does not exist in the model; there are {', '.join(names) or 'none'}"
                )
        for pair in self.swaps:
            unplugged = [name for name in pair if self.outputs is not None and name not in self.outputs]
            if unplugged:
                raise RigError(
                    f"outputs {pair[0]!r} and {pair[1]!r} are swapped, but {unplugged[0]!r} is not connected; connect both"
                )

    def for_channel(self, place: str, channel: str) -> tuple[Stage, ...]:
        """The stages that one channel passes in one place."""
        return tuple(s for s in getattr(self, place) if s.channel in (channel, ALL))

    @property
    def needs_substeps(self) -> bool:
        """Whether a stage must see what happens between samples."""
        return any(s.needs_substeps for s in (*self.actuators, *self.sensors))

    def to_data(self) -> dict[str, Any]:
        """Plain data for JSON."""
        data: dict[str, Any] = {"inputs": self.inputs, "outputs": self.outputs, "swaps": self.swaps}
        data["force_measured"] = self.force_measured
        for place in PLACES:
            data[place] = [{"stage": s.name, **dataclasses.asdict(s)} for s in getattr(self, place)]
        ideal = Chain()
        return {key: value for key, value in data.items() if getattr(self, key) != getattr(ideal, key)}

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Chain:
        """The chain of `to_data`.

        Raises:
            RigError: a key or stage is unknown.
        """
        if not isinstance(data, Mapping):
            raise RigError(f"the measurement chain is {data!r}; expected a table")
        allowed = [f.name for f in fields(cls)]
        for key in data:
            if key not in allowed:
                raise RigError(
                    f"the measurement chain has an unknown key {key!r}; expected {', '.join(allowed)}"
                )
        values: dict[str, Any] = {
            key: tuple(data[key]) for key in ("inputs", "outputs") if data.get(key) is not None
        }
        values["force_measured"] = bool(data.get("force_measured", False))
        values["swaps"] = tuple((a, b) for a, b in data.get("swaps", ()))
        for place in PLACES:
            values[place] = tuple(_stage(item) for item in data.get(place, ()))
        return cls(**values)

    def __repr__(self) -> str:
        parts = [f"{len(getattr(self, place))} {place}" for place in PLACES if getattr(self, place)]
        return f"Chain({', '.join(parts) or 'ideal'})"


def _stage(item: Mapping[str, Any]) -> Stage:
    settings = dict(item)
    kind = settings.pop("stage", None)
    if kind not in STAGES:
        raise RigError(f"stage {kind!r} is unknown; expected one of {', '.join(STAGES)}")
    try:
        return STAGES[kind](**settings)
    except TypeError:
        raise RigError(
            f"stage {kind!r} was given {json.dumps(settings)}; expected {', '.join(f.name for f in fields(STAGES[kind]))}"
        ) from None
