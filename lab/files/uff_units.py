"""Units in universal files: labels of axes, specific data types and the unit system of data set 164."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lab.errors import FileError
from lab.files.units import to_si

SPECIFIC = {
    3: ("strain", "1"),
    8: ("displacement", "m"),
    9: ("reaction", "N"),
    11: ("velocity", "m/s"),
    12: ("acceleration", "m/s^2"),
    13: ("force", "N"),
    15: ("pressure", "Pa"),
}
"""Specific data type: what it measures, and the SI unit of that."""

TYPES = {"m": 8, "m/s": 11, "m/s^2": 12, "rad": 8, "rad/s": 11, "rad/s^2": 12, "Pa": 15}
"""Specific data type of a response in that SI unit; forces are of type 13, all others of type 0."""

DIMENSIONS = {"m": (1, 0), "m/s": (1, 0), "m/s^2": (1, 0), "N": (0, 1), "N m": (1, 1), "Pa": (-2, 1)}
"""Powers of length and force in an SI unit; none in those not listed."""

_SAME = 1e-4
"""Relative difference of factors that come from roundings of one."""


@dataclass(frozen=True)
class UnitSystem:
    """Units of a file: numbers in it are SI numbers times these factors.

    Source: universal file data set 164: "to convert from universal file units to SI divide by the factor".
    """

    length: float
    force: float

    def factor(self, si: str) -> float:
        """SI values per number in the file."""
        length, force = DIMENSIONS.get(si, (0, 0))
        return self.length**-length * self.force**-force


def unit_system(sets: Sequence[Mapping[str, Any]]) -> UnitSystem | None:
    """The unit system of data set 164, or None where there is none.

    Raises:
        FileError: two different ones, or impossible factors.
    """
    found = {UnitSystem(float(each["length"]), float(each["force"])) for each in sets if each["type"] == 164}
    if len(found) > 1:
        raise FileError("holds two unit systems (data set 164); expected one")
    for system in found:
        if not (system.length > 0 and system.force > 0):
            raise FileError(
                f"its unit system (data set 164) has factors {system.length:g} and {system.force:g}; "
                "expected positive ones"
            )
        return system
    return None


def unit_of(
    specific: int, label: str, system: UnitSystem | None, believed: str | None, *, turning: bool = False
) -> tuple[str, float] | None:
    """SI unit of an axis and SI values per number, or None where the file does not tell.

    Args:
        specific: specific data type.
        label: units label, as written.
        system: of data set 164.
        believed: "labels" or "dataset 164" where both tell and differ.
        turning: whether the direction is a rotation.

    Raises:
        FileError: type, label and unit system contradict each other.
    """
    written = _known(label)
    typed = SPECIFIC.get(specific, ("", ""))[1]
    if turning and typed.startswith("m"):
        typed = "rad" + typed[1:]
    if written is None:
        return None if not typed or system is None else (typed, system.factor(typed))
    si, factor = written
    if typed and si != typed:
        raise FileError(
            f"is of type {specific} ({SPECIFIC[specific][0]}) with the units label {label!r}; "
            "state its unit in a recipe"
        )
    if system is None or si not in DIMENSIONS:
        return si, factor
    other = system.factor(si)
    if abs(other / factor - 1) < _SAME or believed == "labels":
        return si, factor
    if believed == "dataset 164":
        return si, other
    raise FileError(
        f"has the units label {label!r} (factor {factor:g} to {si}) in a file whose unit system says {other:g}; "
        'state uff_units = "labels" or "dataset 164" in a recipe'
    )


def _known(label: str) -> tuple[str, float] | None:
    text = re.sub(r"^[\[(]([^\[\]()]*)[\])]$", r"\1", label.strip()).strip()
    if not text or text.upper() in ("NONE", "UNKNOWN", "?"):
        return None
    return to_si(text)
