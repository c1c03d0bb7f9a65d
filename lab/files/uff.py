"""Universal file (UFF, UNV) -> time signals, frequency responses, modes and geometry."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from identification.modes import Modes
from identification.recording import KINDS
from identification.response import FrequencyResponse
from lab.errors import FileError
from lab.files.importing_columns import Source
from lab.files.importing_rate import AGREE, check_time, even_rate
from lab.files.recipe import Recipe
from lab.files.recording_geometry import Geometry
from lab.files.uff_geometry import geometry_of
from lab.files.uff_modes import modes_of
from lab.files.uff_points import label_of
from lab.files.uff_responses import response_of
from lab.files.uff_sets import READ, read_sets
from lab.files.uff_units import SPECIFIC, UnitSystem, unit_of, unit_system

PROGRAM = "virtual modal lab"
"""Who wrote a file: in those of the lab itself, the ID lines hold names, sides, kinds and rates."""

TIME, RESPONSE = 17, 4
"""Specific data type of a time axis, and function type of a frequency response."""


@dataclass(frozen=True, eq=False)
class UniversalFile:
    """What a universal file holds.

    Attributes:
        sources: time signals in SI, one source per record.
        response: frequency responses, or None.
        modes: or None.
        geometry: or None.
        title: of the model.
        notes: what was left out or settled, one sentence each.
    """

    sources: tuple[Source, ...]
    response: FrequencyResponse | None
    modes: Modes | None
    geometry: Geometry | None
    title: str
    notes: tuple[str, ...]


def read_uff(path: Path, recipe: Recipe) -> UniversalFile:
    """Everything in a universal file that the lab knows to read, in SI.

    A channel is called by what it measures and its point, such as "acceleration 12+X"; a channel that comes
    again begins the next record.

    Args:
        path: the file.
        recipe: units of channels, the rate and what to believe, where the file leaves them open.

    Raises:
        FileError: damaged, contradictory units, uneven time, or frequency responses that do not fit together.
    """
    sets = read_sets(path)
    system = unit_system(sets)
    functions = [each for each in sets if each["type"] == 58]
    signals = [each for each in functions if _is_time(each)]
    lines = [each for each in functions if each["func_type"] == RESPONSE]
    own = any(each["type"] == 151 and _text(each, "program") == PROGRAM for each in sets)
    geometry, note = geometry_of(sets, system, recipe)
    notes = [*_left_out(sets, signals, lines), *([note] if note else [])]
    sources = [_source(path, group, system, recipe, own) for group in _grouped(signals, own)]
    title = next((_text(each, "model_name") for each in sets if each["type"] == 151), "")
    return UniversalFile(
        tuple(sources),
        response_of(lines, system, recipe, own=own) if lines else None,
        modes_of([each for each in sets if each["type"] == 55], system, recipe, notes),
        geometry,
        "" if title.upper() == "NONE" else title,
        tuple(notes),
    )


def _is_time(each: Mapping[str, Any]) -> bool:
    return each["func_type"] == 1 or (each["func_type"] == 0 and each["abscissa_spec_data_type"] == TIME)


def _left_out(sets: Sequence[Mapping[str, Any]], *taken: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the file holds besides, one sentence per kind."""
    used = {id(each) for group in taken for each in group}
    rest = [each for each in sets if id(each) not in used]
    types = Counter(int(each["type"]) for each in rest if each["type"] not in READ)
    functions = Counter(int(each["func_type"]) for each in rest if each["type"] == 58)
    return [
        *(f"{count} data set(s) of type {kind} left out" for kind, count in sorted(types.items())),
        *(f"{count} function(s) of type {kind} left out" for kind, count in sorted(functions.items())),
    ]


def _text(each: Mapping[str, Any], key: str) -> str:
    return str(each.get(key, "")).strip()


def _name(each: Mapping[str, Any], own: bool) -> str:
    if own:
        return _text(each, "id1")
    label = label_of(each, "rsp")
    if label == "0":
        # No point at all: loggers name the channel on the first ID line.
        return _text(each, "id1") or "NONE"
    what = SPECIFIC.get(each["ordinate_spec_data_type"], ("",))[0]
    return f"{what} {label}".strip()


def _grouped(signals: Sequence[Mapping[str, Any]], own: bool) -> list[list[Mapping[str, Any]]]:
    """Signals record by record."""
    groups: list[list[Mapping[str, Any]]] = []
    seen: set[tuple[str, str]] = set()
    for each in signals:
        key = (_name(each, own), _text(each, "id2") if own else "")
        if key in seen and not own and label_of(each, "rsp") == "0":
            raise FileError(
                f"holds several signals {key[0]!r} without point; nothing tells channels from records"
            )
        if not groups or key in seen:
            groups.append([])
            seen = set()
        groups[-1].append(each)
        seen.add(key)
    return groups


def _source(
    path: Path, group: Sequence[Mapping[str, Any]], system: UnitSystem | None, recipe: Recipe, own: bool
) -> Source:
    columns, units, sides = {}, {}, {}
    listed, stated = _stated_units(recipe)
    axes = {(len(each["data"]), each["x"][0], each["x"][-1]) for each in group}
    if len(axes) > 1:
        raise FileError(
            f"signals of one record differ in length or time: {sorted(axes)[:2]}; expected the same in all"
        )
    for each in group:
        name, side = _name(each, own), _side(each, own)
        if name in columns:
            name = f"{name} ({side})"
        specific, label = each["ordinate_spec_data_type"], each["ordinate_axis_units_lab"]
        known: tuple[str, float] | None
        if name in stated or (listed and name not in listed):
            known = None  # the recipe's unit is that of the numbers as written
        else:
            turning = abs(each["rsp_dir"]) > 3
            known = _named(name, lambda s=specific, u=label, t=turning: _unit(s, u, system, recipe, t))
        factor = 1.0
        if known is not None:
            units[name], factor = known
        columns[name] = each["data"] * factor
        if side:
            sides[name] = side
    preview = tuple(
        f"{name}: {len(data)} samples, {units.get(name, 'no unit')}" for name, data in columns.items()
    )
    kind = re.search(r"kind (\w+)", _text(group[0], "id4")) if own else None
    return Source(
        path,
        columns,
        units,
        preview=preview[:40],
        sides=sides,
        sample_rate=_rate(group[0], recipe),
        kind=kind[1] if kind and kind[1] in KINDS else "",
        start_time=started if own and (started := _text(group[0], "id3")) != "NONE" else "",
    )


def _unit(
    specific: int, label: str, system: UnitSystem | None, recipe: Recipe, turning: bool
) -> tuple[str, float] | None:
    return unit_of(specific, label, system, recipe.uff_units, turning=turning)


def _named(name: str, find: Any) -> Any:
    try:
        return find()
    except FileError as error:
        raise FileError(f"channel {name!r} {error}") from None


def _stated_units(recipe: Recipe) -> tuple[set[str], set[str]]:
    """Columns that the recipe takes, and those of them for which it states the unit."""
    parts = [*recipe.inputs, *recipe.outputs]
    for part in parts:
        if isinstance(part.column, int):
            raise FileError(f"column = {part.column}: signals of a universal file go by their names")
    taken = {str(part.column or part.name): part for part in parts}
    return set(taken), {name for name, part in taken.items() if part.unit is not None}


def _side(each: Mapping[str, Any], own: bool) -> str:
    if own:
        return _text(each, "id2")
    specific = each["ordinate_spec_data_type"]
    return "input" if specific == 13 else "output" if specific in (3, 8, 11, 12) else ""


def _rate(each: Mapping[str, Any], recipe: Recipe) -> float:
    """Sample rate [Hz]: that of the recipe or of an ID line where it fits, as the step has six digits only."""
    if each["abscissa_spacing"] == 0:
        if isinstance(recipe.sample_rate, float):
            check_time(each["x"], recipe.sample_rate)
            return recipe.sample_rate
        return even_rate(each["x"])
    step = float(each["abscissa_inc"])
    if not step > 0:
        raise FileError(f"a signal has a time step of {step:g} s; expected a positive one")
    match = re.search(r"sample rate ([0-9.eE+-]+) Hz", _text(each, "id5"))
    better = (
        recipe.sample_rate if isinstance(recipe.sample_rate, float) else float(match[1]) if match else 0.0
    )
    if better and abs(better * step - 1) > AGREE:
        raise FileError(f"sample rate {better:g} Hz does not fit its time step of {step:g} s; correct it")
    return better or 1 / step
