"""Where channels measure, for formats that want a node and a direction: from a table, a model, or their names."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from identification.recording import Channel
from lab.errors import FileError, StudyError
from lab.files.recipe_parts import Part
from lab.files.recording_geometry import Geometry
from lab.files.uff_points import DIRECTIONS, point_of

Pair = Annotated[list[int], Field(min_length=2, max_length=2)]

CODES = {name: code for code, name in DIRECTIONS.items() if name}


class PointPart(Part):
    """One channel: the node it sits at, and the direction it measures in."""

    node: Annotated[int, Field(ge=1)]
    direction: Literal["+X", "+Y", "+Z", "-X", "-Y", "-Z", "+RX", "+RY", "+RZ", "-RX", "-RY", "-RZ"]
    position: Annotated[list[float], Field(min_length=3, max_length=3)] | None = None


class PointsFile(Part):
    """Channels by name, and pairs of nodes that are drawn joined; positions in metres."""

    channels: dict[str, PointPart]
    lines: list[Pair] = Field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Points:
    """Where channels measure.

    Attributes:
        places: node and code of the direction of a channel, by name.
        geometry: positions of the nodes, or None.
        notes: what could not be told, one sentence each.
    """

    places: dict[str, tuple[int, int]]
    geometry: Geometry | None = None
    notes: tuple[str, ...] = field(default=())


def load_points(path: str | Path) -> Points:
    """The points in a TOML file.

    Raises:
        FileError: the file cannot be read, or one node has two positions.
        StudyError: not TOML, an unknown key or an impossible value.
    """
    path = Path(path)
    try:
        table = PointsFile.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror}); expected points (TOML)") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise StudyError(f"{path}: is not TOML ({error})") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise StudyError(
            f"{path}: {where}: {first['msg'].lower()}; expected channels.NAME = "
            '{ node = 1, direction = "+X", position = [x, y, z] } and lines = [[1, 2]]'
        ) from None
    positions: dict[int, list[float]] = {}
    for name, point in table.channels.items():
        if point.position is not None and positions.setdefault(point.node, point.position) != point.position:
            raise FileError(f"{path}: node {point.node} of {name!r} has two positions; expected one")
    places = {name: (point.node, CODES[point.direction]) for name, point in table.channels.items()}
    lines = tuple((a, b) for a, b in table.lines)
    try:
        geometry = Geometry(tuple(positions), list(positions.values()), lines) if positions else None  # type: ignore[arg-type]
    except FileError as error:
        raise FileError(f"{path}: {error}") from None
    return Points(places, geometry)


def named_points(channels: Sequence[Channel]) -> Points:
    """Points that the names themselves tell: "force 12+X" of universal files, "acc3.x" of models.

    Nodes of the latter are numbered by their order; channels without axis have no point.
    """
    places: dict[str, tuple[int, int]] = {}
    bases: dict[str, int] = {}
    used = {point[0] for channel in channels if (point := point_of(channel.name))}
    for channel in channels:
        point = point_of(channel.name)
        if point is not None:
            places[channel.name] = point
            continue
        base, dot, axis = channel.name.rpartition(".")
        if dot and axis in ("x", "y", "z"):
            free = max({*used, *bases.values()}, default=0) + 1
            turning = 3 if channel.unit.startswith("rad") else 0
            places[channel.name] = (bases.setdefault(base, free), "xyz".index(axis) + 1 + turning)
    return Points(places)
