"""Matching: a recording and a model, brought together by the names of their channels."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from identification.recording import Channel, Recording
from identification.response import FrequencyResponse
from lab.errors import FileError, RigError, StudyError, UnknownNameError
from lab.rig import Rig

SIDES = ("inputs", "outputs")
Measured = TypeVar("Measured", Recording, FrequencyResponse)
Names = Mapping[str, Any]
"""New names by old ones; under "inputs" and "outputs", those of one side alone."""


def read_mapping(path: str | Path) -> dict[str, Any]:
    """New names of channels by old ones, from a TOML file: `recorded = "name in the model"`, a line for each.

    The tables [inputs] and [outputs] rename on one side alone, where both sides have a channel of that name.

    Raises:
        FileError: the file cannot be read.
        StudyError: it is not TOML, or a new name is no text.
    """
    path = Path(path)
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror}); expected a TOML file of names") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise StudyError(
            f'{path}: is not TOML ({error}); expected lines such as "name in the recording" = "name in the model"'
        ) from None
    sided = {side: _flat(document.pop(side), path) for side in SIDES if isinstance(document.get(side), dict)}
    return {**_flat(document, path), **sided}


def renamed(recording: Measured, names: Names) -> Measured:
    """The recording with other names of channels.

    Args:
        recording: as measured, samples or frequency responses.
        names: new names by old ones, as `read_mapping` gives them.

    Raises:
        UnknownNameError: the recording has no channel of an old name.
        StudyError: two channels of a side would have the same name.
    """
    both = {old: new for old, new in names.items() if old not in SIDES}
    _require(both, (*recording.inputs, *recording.outputs), "the recording", "channel")
    sides = {}
    for side in SIDES:
        channels = getattr(recording, side)
        own = names.get(side, {})
        _require(own, channels, "the recording", f"{side[:-1]} channel")
        known = {**both, **own}
        new = [replace(channel, name=known.get(channel.name, channel.name)) for channel in channels]
        listed = [channel.name for channel in new]
        twice = [name for name in listed if listed.count(name) > 1]
        if twice:
            raise StudyError(
                f"{side[:-1]} channel {twice[0]!r} would appear twice after renaming; expected unique new names"
            )
        sides[side] = tuple(new)
    return replace(recording, inputs=sides["inputs"], outputs=sides["outputs"])


def matched(rig: Rig, recording: Recording | FrequencyResponse) -> Rig:
    """The rig with the channels of the recording connected, in their order.

    Raises:
        UnknownNameError: the recording has a channel that the model lacks.
        RigError: a channel is recorded in another unit than the model's sensor reads.
    """
    everything = rig.with_chain(replace(rig.chain, inputs=None, outputs=None))
    for side in SIDES:
        known = {channel.name: channel for channel in getattr(everything, side)}
        for channel in getattr(recording, side):
            if channel.name not in known:
                raise UnknownNameError(
                    f"the recording has {side[:-1]} channel {channel.name!r}, which model {rig.name!r} lacks; the model has "
                    f"{', '.join(known) or 'none'}; rename it with --map FILE.toml or add it to the model"
                )
            unit = known[channel.name].unit
            if channel.unit != unit:
                raise RigError(
                    f"{side[:-1]} channel {channel.name!r} is recorded in {channel.unit}, and model {rig.name!r} has it in "
                    f"{unit}; rename it with --map FILE.toml or correct the unit in the recording"
                )
    return rig.connected(
        inputs=[channel.name for channel in recording.inputs],
        outputs=[channel.name for channel in recording.outputs],
    )


def placed(recording: Measured, rig: Rig) -> Measured:
    """The recording with its channels at the degrees of freedom where the model has them.

    A channel that the model lacks, such as one more sensor on a floor, stays as it is.

    Raises:
        UnknownNameError: the model has none of the recorded outputs.
    """
    everything = rig.with_chain(replace(rig.chain, inputs=None, outputs=None))
    known = {
        side: {channel.name: channel.dof for channel in getattr(everything, side) if channel.dof}
        for side in SIDES
    }
    if not any(channel.name in known["outputs"] for channel in recording.outputs):
        raise UnknownNameError(
            f"none of the outputs {', '.join(channel.name for channel in recording.outputs)} reads a place of model "
            f"{rig.name!r}; expected some of {', '.join(known['outputs']) or 'none'}; rename them with --map FILE.toml"
        )
    inputs, outputs = (
        tuple(replace(channel, dof=known[side].get(channel.name, channel.dof)) for channel in channels)
        for side, channels in (("inputs", recording.inputs), ("outputs", recording.outputs))
    )
    return replace(recording, inputs=inputs, outputs=outputs)


def same_channels(
    baseline: Recording | FrequencyResponse, recording: Recording | FrequencyResponse
) -> Recording | FrequencyResponse:
    """The baseline with the channels of the recording alone, in their order.

    Raises:
        UnknownNameError: the baseline lacks one.
        StudyError: one of both has samples and the other frequency responses.
    """
    if isinstance(baseline, FrequencyResponse) != isinstance(recording, FrequencyResponse):
        kinds = [
            "frequency responses" if isinstance(each, FrequencyResponse) else "samples"
            for each in (baseline, recording)
        ]
        raise StudyError(f"the baseline holds {kinds[0]} and the recording {kinds[1]}; expected both alike")
    for side in SIDES:
        wanted = {channel.name: channel for channel in getattr(recording, side)}
        _require(wanted, getattr(baseline, side), "the baseline", f"{side[:-1]} channel")
    inputs = [channel.name for channel in recording.inputs]
    outputs = [channel.name for channel in recording.outputs]
    return baseline.select(inputs=inputs, outputs=outputs)


def _flat(table: Mapping[str, Any], path: Path, inside: str = "") -> dict[str, str]:
    """Old names with their dots: TOML reads `acc1.x = …` as a table acc1 with a key x."""
    found: dict[str, str] = {}
    for key, value in table.items():
        name = inside + key
        if isinstance(value, dict):
            found |= _flat(value, path, f"{name}.")
        elif isinstance(value, str):
            found[name] = value
        else:
            raise StudyError(f"{path}: {name!r} is renamed to {value!r}; expected a name in quotes")
    return found


def _require(names: Mapping[str, Any], channels: Sequence[Channel], owner: str, what: str) -> None:
    known = [channel.name for channel in channels]
    for name in names:
        if name not in known:
            raise UnknownNameError(f"{owner} has no {what} {name!r}; there are {', '.join(known) or 'none'}")
