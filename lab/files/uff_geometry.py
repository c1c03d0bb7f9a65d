"""Nodes and trace lines of universal files: data sets 15, 2411 and 82."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lab.errors import FileError
from lab.files.recipe import Recipe
from lab.files.recording_geometry import Geometry
from lab.files.uff_units import UnitSystem
from lab.files.units import to_si


def geometry_of(
    sets: Sequence[Mapping[str, Any]], system: UnitSystem | None, recipe: Recipe
) -> tuple[Geometry | None, str]:
    """Geometry of a file, or None and the reason where there is one that cannot be read.

    Args:
        sets: all data sets.
        system: unit system of the file, or None.
        recipe: may state the unit of length.

    Raises:
        FileError: a node appears twice at different places, or the unit is not one of length.
    """
    points = [each for each in sets if each["type"] in (15, 2411)]
    if not points:
        return None, ""
    if recipe.length_unit is not None:
        si, factor = to_si(recipe.length_unit)
        if si != "m":
            raise FileError(f"length_unit = {recipe.length_unit!r} is no length; expected m, mm, in, …")
    elif system is not None:
        factor = system.factor("m")
    else:
        return None, "geometry left out: nothing states its unit; say length_unit in a recipe"
    places: dict[int, np.ndarray] = {}
    for each in points:
        for node, place in zip(each["node_nums"], _coordinates(each), strict=True):
            if not np.array_equal(places.setdefault(int(node), place), place):
                raise FileError(f"node {int(node)} appears at two places; expected one")
    lines = [line for each in sets if each["type"] == 82 for line in _lines(each["nodes"])]
    known = tuple(line for line in lines if set(line) <= set(places))
    note = (
        ""
        if len(known) == len(lines)
        else f"{len(lines) - len(known)} trace line(s) to unknown nodes left out"
    )
    return Geometry(tuple(places), np.array(list(places.values())) * factor, known), note


def _coordinates(each: Mapping[str, Any]) -> np.ndarray:
    return np.stack([np.asarray(each[axis], dtype=float) for axis in "xyz"], axis=1)  # (n_nodes, 3)


def _lines(trace: Sequence[float]) -> list[tuple[int, int]]:
    """Pairs of nodes of a trace line; 0 lifts the pen."""
    nodes = [int(node) for node in trace]
    return [(a, b) for a, b in itertools.pairwise(nodes) if a and b]
