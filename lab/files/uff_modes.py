"""Modes of universal files: data sets 55 of normal modes and of complex eigenvalues."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identification.modes import Modes
from identification.recording import Channel
from lab.errors import FileError
from lab.files.recipe import Recipe
from lab.files.uff_points import DIRECTIONS
from lab.files.uff_units import SPECIFIC, UnitSystem
from lab.files.units import to_si

NORMAL, COMPLEX = 2, (3, 7)
"""Analysis types."""

MOTION = {8: "m", 11: "m/s", 12: "m/s^2"}
"""Specific data types of shapes: SI unit of a translation."""


def modes_of(
    sets: Sequence[Mapping[str, Any]], system: UnitSystem | None, recipe: Recipe, notes: list[str]
) -> Modes | None:
    """The modes of data sets 55, or None where there is none.

    Every direction of every node is a channel, apart from those at rest in all modes, which a file writes as
    zero whether they were measured or not.

    Args:
        sets: data sets of type 55.
        system: unit system of the file, or None where SI is as good as any: a shape has no size of its own,
            but rotations beside translations do.
        recipe: may state the unit of length.
        notes: what was left out is added here.

    Raises:
        FileError: shapes of several kinds or at different nodes, an unstable or impossible eigenvalue.
    """
    modal = [each for each in sets if each["analysis_type"] in (NORMAL, *COMPLEX)]
    if len(modal) < len(sets):
        notes.append(f"{len(sets) - len(modal)} data set(s) 55 that are no modes left out")
    if not modal:
        return None
    kinds = {each["spec_data_type"] for each in modal}
    if len(kinds) > 1 or not kinds <= set(MOTION):
        raise FileError(
            f"its modes (data sets 55) are of specific types {sorted(kinds)}; expected one of {sorted(MOTION)} in all"
        )
    kind = kinds.pop()
    nodes = [int(node) for node in modal[0]["node_nums"]]
    if any([int(node) for node in each["node_nums"]] != nodes for each in modal):
        raise FileError("its modes (data sets 55) have shapes at different nodes; expected the same in all")
    width = 6 if all("r4" in each for each in modal) else 3
    stacked = np.array([[each[f"r{k}"] for k in range(1, width + 1)] for each in modal], dtype=complex)
    shapes = stacked.transpose(2, 1, 0).reshape(len(nodes) * width, len(modal))  # (n_channels, n_modes)
    moving = np.any(shapes != 0, axis=1)
    notes.append(
        f"{int(np.sum(~moving))} direction(s) at rest in all modes left out"
    ) if not moving.all() else None
    channels = [_channel(node, code, kind) for node in nodes for code in range(1, width + 1)]
    length = _length(system, recipe)
    factors = np.array([length if channel.unit.startswith("m") else 1.0 for channel in channels])
    frequency, damping = np.array([_oscillation(each) for each in modal]).T
    rank = np.argsort(frequency, kind="stable")
    kept = tuple(channel for channel, moves in zip(channels, moving, strict=True) if moves)
    return Modes(frequency[rank], damping[rank], (shapes * factors[:, None])[moving][:, rank], kept)


def _channel(node: int, code: int, kind: int) -> Channel:
    unit = MOTION[kind] if code <= 3 else "rad" + MOTION[kind][1:]
    return Channel(f"{SPECIFIC[kind][0]} {node}{DIRECTIONS[code]}", unit)


def _length(system: UnitSystem | None, recipe: Recipe) -> float:
    if recipe.length_unit is not None:
        return to_si(recipe.length_unit)[1]
    return 1.0 if system is None else system.factor("m")


def _oscillation(each: Mapping[str, Any]) -> tuple[float, float]:
    """Undamped natural frequency [Hz] and damping ratio."""
    if each["analysis_type"] == NORMAL:
        return float(each["freq"]), float(each["modal_damp_vis"])
    pole = complex(each["eig"])
    size = abs(pole)
    if not size > 0 or not np.isfinite(size):
        raise FileError(f"a mode (data set 55) has the eigenvalue {pole}; expected one that oscillates")
    return size / (2 * np.pi), -pole.real / size
