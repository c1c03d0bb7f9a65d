"""Frequency responses of universal files: functions of type 4 in data sets 58, put together to one matrix."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identification.errors import IdentificationError
from identification.recording import Channel
from identification.response import FrequencyResponse
from lab.errors import FileError
from lab.files.recipe import Recipe
from lab.files.recipe_parts import ChannelPart
from lab.files.uff_points import label_of
from lab.files.uff_units import SPECIFIC, UnitSystem, unit_of
from lab.files.units import to_si

Function = Mapping[str, Any]


def response_of(
    lines: Sequence[Function], system: UnitSystem | None, recipe: Recipe, *, own: bool = False
) -> FrequencyResponse:
    """The responses of all functions, output by output and input by input.

    Channels are called by what they measure and their point; those named in the recipe take its unit, scale
    and name, and only they are taken.

    Args:
        lines: functions of type 4.
        system: unit system of the file, or None.
        recipe: units that the file leaves open.
        own: whether the lab wrote the file, so that ID lines name the channels.

    Raises:
        FileError: a unit is missing, frequencies differ, a pair of output and input is missing or twice.
    """
    chosen = {_names(each, own): each for each in lines}
    if len(chosen) < len(lines):
        names = [_names(each, own) for each in lines]
        double = next(pair for pair in names if names.count(pair) > 1)
        raise FileError(
            f"the response of {double[0]!r} to {double[1]!r} appears twice; expected one of each pair"
        )
    outputs = _taken([pair[0] for pair in chosen], recipe.outputs, "outputs")
    inputs = _taken([pair[1] for pair in chosen], recipe.inputs, "inputs")
    frequency = _frequency(next(iter(chosen.values())))
    values = np.zeros((frequency.size, len(outputs), len(inputs)), dtype=complex)
    made: dict[str, dict[str, Channel]] = {"outputs": {}, "inputs": {}}
    for row, (output, part_out) in enumerate(outputs.items()):
        for column, (input_, part_in) in enumerate(inputs.items()):
            each = chosen.get((output, input_))
            if each is None:
                raise FileError(
                    f"the response of {output!r} to {input_!r} is missing; name complete [[outputs]] and "
                    "[[inputs]] in a recipe"
                )
            if not np.array_equal(_frequency(each), frequency):
                raise FileError(
                    f"the response of {output!r} to {input_!r} has other frequencies than the first"
                )
            above, below = _axes(each)
            out_channel, up = _channel(output, part_out, *above, system, recipe)
            in_channel, down = _channel(input_, part_in, *below, system, recipe)
            for side, channel in (("outputs", out_channel), ("inputs", in_channel)):
                if made[side].setdefault(channel.name, channel) != channel:
                    raise FileError(f"channel {channel.name!r} has several units; expected one")
            values[:, row, column] = each["data"] * up / down
    try:
        pair = tuple(made["inputs"].values()), tuple(made["outputs"].values())
        return FrequencyResponse(frequency, values, 0.0, *pair)
    except IdentificationError as error:
        raise FileError(str(error)) from None


def _names(each: Function, own: bool) -> tuple[str, str]:
    """Names of response and reference."""
    if own:
        return str(each["id1"]).strip(), str(each["id2"]).strip()
    above, below = (
        f"{SPECIFIC.get(each[f'{axis}_spec_data_type'], ('',))[0]} {label_of(each, end)}".strip()
        for axis, end in (("ordinate", "rsp"), ("orddenom", "ref"))
    )
    return above, below


def _taken(names: Sequence[str], parts: Sequence[ChannelPart], side: str) -> dict[str, ChannelPart | None]:
    """Names in the file of the channels that are taken, and what the recipe says of them."""
    there = dict.fromkeys(names)
    if not parts:
        return dict(there)
    wanted = {str(part.column or part.name): part for part in parts}
    missing = [name for name in wanted if name not in there]
    if missing:
        raise FileError(f"no response has {missing[0]!r} among its {side}; there are {', '.join(there)}")
    return {name: part for name, part in wanted.items()}


def _frequency(each: Function) -> np.ndarray:
    x = np.asarray(each["x"], dtype=float)
    if each["abscissa_spacing"] != 0:
        x = each["abscissa_min"] + each["abscissa_inc"] * np.arange(x.size)
    if not np.all(np.diff(x) > 0):
        raise FileError("frequencies of a response do not rise from line to line; expected them to")
    return x


def _axes(each: Function) -> tuple[tuple[int, str, bool], tuple[int, str, bool]]:
    """Specific type, units label and whether it turns, of ordinate numerator and denominator."""
    above, below = str(each["ordinate_axis_units_lab"]).strip(), str(each["orddenom_axis_units_lab"]).strip()
    if below.upper() in ("", "NONE") and "/" in above:
        above, below = _split(above, below)
    turns = abs(int(each["rsp_dir"])) > 3, abs(int(each["ref_dir"])) > 3
    return (each["ordinate_spec_data_type"], above, turns[0]), (
        each["orddenom_spec_data_type"],
        below,
        turns[1],
    )


def _split(above: str, below: str) -> tuple[str, str]:
    """Some programs write the unit of the quotient, such as m/s^2/N, above and none below."""
    head, _, tail = above.rpartition("/")
    try:
        to_si(head)
        to_si(tail)
    except FileError:
        return above, below
    return head, tail


def _channel(
    name: str,
    part: ChannelPart | None,
    specific: int,
    label: str,
    turning: bool,
    system: UnitSystem | None,
    recipe: Recipe,
) -> tuple[Channel, float]:
    """The channel, and SI values per number in the file."""
    scale = 1.0 if part is None else part.scale
    if part is not None and part.offset:
        raise FileError(f"channel {name!r} of a frequency response takes no offset")
    called, dof = (name, "") if part is None else (part.name, part.dof)
    if part is not None and part.unit is not None:
        si, factor = to_si(part.unit)
        return Channel(called, si, dof), scale * factor
    try:
        known = unit_of(specific, label, system, recipe.uff_units, turning=turning)
    except FileError as error:
        raise FileError(f"channel {name!r} {error}") from None
    if known is None:
        raise FileError(
            f"channel {name!r} has no unit: neither a units label nor type and unit system; state it in a recipe"
        )
    return Channel(called, known[0], dof), scale * known[1]
