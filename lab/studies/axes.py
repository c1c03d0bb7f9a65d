"""Axes of a study: keys of the scenario and the values that they take."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from lab.errors import StudyError
from lab.scenario import Table, explain


class Range(Table):
    """Equally spaced values: numbers apart by the same step, or on a logarithmic scale by the same factor.

    Attributes:
        first, last: both are among the values.
        count: how many values.
        scale: linear or log.
    """

    first: float
    last: float
    count: Annotated[int, Field(ge=2)]
    scale: Literal["linear", "log"] = "linear"

    def values(self) -> tuple[float, ...]:
        """The values; whole numbers where both ends and the step are whole."""
        if self.scale == "log":
            return tuple(np.geomspace(self.first, self.last, self.count).tolist())
        step = (self.last - self.first) / (self.count - 1)
        if step.is_integer() and self.first.is_integer():
            return tuple(int(self.first) + k * int(step) for k in range(self.count))
        return tuple(np.linspace(self.first, self.last, self.count).tolist())


@dataclass(frozen=True)
class Axis:
    """Keys of the scenario that step together.

    Attributes:
        paths: dotted paths into the scenario, such as effects.0.k3.
        values: of each path, one per step.
    """

    paths: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]

    def __len__(self) -> int:
        return len(self.values[0])

    def __post_init__(self) -> None:
        texts = [json.dumps(self.setting(step), default=str) for step in range(len(self))]
        if len(set(texts)) < len(texts):
            twice = next(text for text in texts if texts.count(text) > 1)
            raise StudyError(f"{twice} is twice in [vary]; expected once, and more runs by repeats")

    def setting(self, step: int) -> dict[str, Any]:
        """What the keys are set to in a step."""
        return {path: values[step] for path, values in zip(self.paths, self.values, strict=True)}


def axes_of(vary: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> tuple[Axis, ...]:
    """The axes of `[vary]`, one per key; or of each `[[vary]]`, whose keys step together.

    Raises:
        StudyError: neither a list nor a range, an empty list, lists of different lengths, a key named twice.
    """
    if isinstance(vary, Mapping):
        axes = [Axis((path,), (values,)) for path, values in _listed(vary)]
    else:
        axes = [_zipped(table) for table in vary]
    paths = [path for axis in axes for path in axis.paths]
    twice = [path for path in paths if paths.count(path) > 1]
    if twice:
        raise StudyError(f"key {twice[0]!r} in [[vary]] is varied twice; expected once")
    return tuple(axes)


def changed(table: Mapping[str, Any], setting: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a scenario with the keys of a setting changed.

    Raises:
        StudyError: a path that leads nowhere.
    """
    new = copy.deepcopy(dict(table))
    for path, value in setting.items():
        _set(new, path, value)
    return new


def _zipped(table: Mapping[str, Any]) -> Axis:
    listed = list(_listed(table))
    if not listed:
        raise StudyError(
            "[[vary]] is empty; expected dotted keys of the scenario, each with a list or a range"
        )
    lengths = {path: len(values) for path, values in listed}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{path} has {n}" for path, n in lengths.items())
        raise StudyError(f"keys of one [[vary]] step together and need as many values each; {told}")
    return Axis(tuple(path for path, _ in listed), tuple(values for _, values in listed))


def _listed(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Dotted paths and their values; TOML makes tables of dotted keys without quotes."""
    for key, value in table.items():
        path = f"{above}{key}"
        if isinstance(value, Mapping) and not set(value) & set(Range.model_fields):
            yield from _listed(value, f"{path}.")
        else:
            yield path, _values(path, value)


def _values(path: str, value: Any) -> tuple[Any, ...]:
    if isinstance(value, Mapping):
        try:
            spread = Range.model_validate(value)
        except ValidationError as error:
            raise StudyError(f"range of {path!r}: {explain(error, model=Range)}") from None
        if spread.scale == "log" and spread.first * spread.last <= 0:
            raise StudyError(f"range of {path!r}: a log scale needs both ends above zero or both below")
        return spread.values()
    if not isinstance(value, list) or not value:
        raise StudyError(
            f"{path} = {value!r} in [vary]; expected a list of values, or a range such as "
            "{ first = 1, last = 10, count = 4 }"
        )
    return tuple(value)


def _set(table: dict[str, Any], path: str, value: Any) -> None:
    *above, last = path.split(".")
    inner: Any = table
    for key in above:
        # A table that the scenario leaves out is made; whether it may exist is the scenario's to judge.
        inner = inner.setdefault(key, {}) if isinstance(inner, dict) else inner[_position(inner, key, path)]
        if not isinstance(inner, dict | list):
            raise StudyError(f"{path!r} in [vary]: {key!r} is a value, not a table; end the path there")
    inner[last if isinstance(inner, dict) else _position(inner, last, path)] = value


def _position(entries: list[Any], key: str, path: str) -> int:
    if not key.isdecimal() or int(key) >= len(entries):
        allowed = f"0 to {len(entries) - 1}" if entries else "none, the list is empty"
        raise StudyError(f"{path!r} in [vary]: no entry {key!r} in the list; positions are {allowed}")
    return int(key)
