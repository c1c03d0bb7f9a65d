"""Units as people write them, turned into SI: one small table of units and one of prefixes."""

from __future__ import annotations

import math
import re

from lab.errors import FileError

UNITS = {
    "m": ("m", 1.0),
    "in": ("m", 0.0254),
    "ft": ("m", 0.3048),
    "rad": ("rad", 1.0),
    "deg": ("rad", math.pi / 180),
    "g": ("m/s^2", 9.80665),
    "N": ("N", 1.0),
    "lbf": ("N", 4.4482216152605),
    "N m": ("N m", 1.0),
    "V": ("V", 1.0),
    "A": ("A", 1.0),
    "Pa": ("Pa", 1.0),
    "bar": ("Pa", 1e5),
    "K": ("K", 1.0),
    "strain": ("1", 1.0),
    "%": ("1", 0.01),
    "1": ("1", 1.0),
}
"""Unit: (SI unit, how many of them it holds)."""

PREFIXES = {"": 1.0, "G": 1e9, "M": 1e6, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9}

PREFIXED = ("m", "rad", "g", "N", "N m", "V", "A", "Pa", "bar", "strain")
"""Units that take a prefix."""

RATES = {"": "", "/s": "/s", "/s^2": "/s^2", "/s/s": "/s^2"}
"""What may follow a length or an angle, and its SI form."""

_SPELLINGS = {
    "µ": "u",
    "μ": "u",
    "²": "^2",
    "**": "^",
    "s2": "s^2",
    "°": "deg",
    "·": " ",
    "*": " ",
    "Nm": "N m",
    "g_n": "g",
}


def _table() -> dict[str, tuple[str, float]]:
    table = {}
    for name, (si, size) in UNITS.items():
        for prefix, factor in PREFIXES.items() if name in PREFIXED else (("", 1.0),):
            table[prefix + name] = (si, factor * size)
    return table


_TABLE = _table()


def to_si(unit: str) -> tuple[str, float]:
    """The SI unit that `unit` measures in, and the factor that converts a reading to it.

    Args:
        unit: for example "g", "mm/s^2", "kN", "deg/s", "N m".

    Raises:
        FileError: the unit is not in the table.
    """
    text = unit.strip()
    for spelling, plain in _SPELLINGS.items():
        text = text.replace(spelling, plain)
    above, slash, below = re.sub(r"\s*/\s*", "/", text).partition("/")
    si, factor = _TABLE.get(above, ("", 0.0))
    rate = RATES.get(slash + below)
    if not si or rate is None or (rate and si not in ("m", "rad")):
        raise FileError(
            f"unit {unit!r} is unknown; expected one of {', '.join(UNITS)}, with prefix "
            f"{', '.join(filter(None, PREFIXES))} where usual, lengths and angles also per s or s^2"
        )
    return si + rate, factor
