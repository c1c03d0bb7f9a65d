"""The data sets of a universal file as pyuff reads them, held against what the file itself says of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lab.errors import FileError

READ = (15, 55, 58, 82, 151, 164, 2411)
"""Data sets that are read; others are left out with a note."""

IEEE = 2
"""Floating-point format of binary data that is read."""


def read_sets(path: Path) -> list[dict[str, Any]]:
    """All data sets; those of a kind that is not read have their type only.

    Raises:
        FileError: not a universal file, cut off, or damaged.
    """
    import pyuff

    try:
        tail = path.read_bytes()[-4096:].rstrip()
    except OSError as error:
        raise FileError(f"cannot be read ({error.strerror})") from None
    try:
        file = pyuff.UFF(str(path))
        types = [int(kind) for kind in file.get_set_types()]
    except Exception:  # pyuff raises nothing narrower
        raise FileError("cannot be read as a universal file; it is damaged") from None
    if not types:
        raise FileError("holds no data set between lines of -1; expected a universal file (UFF, UNV)")
    if not tail.endswith(b"-1"):
        raise FileError("ends in the middle of a data set; the file was cut off, write it again")
    return [_read(file, number, kind) for number, kind in enumerate(types)]


def _read(file: Any, number: int, kind: int) -> dict[str, Any]:
    if kind not in READ:
        return {"type": kind}
    try:
        found = dict(file.read_sets(number))
    except Exception:  # pyuff raises nothing narrower
        raise FileError(f"data set {number + 1} (type {kind}) cannot be read; it is damaged") from None
    if kind == 58:
        _check_function(found, number)
    fields = {15: "xyz", 2411: "xyz", 55: ("r1", "r2", "r3")}.get(kind, ())
    if any(len(found[field]) != len(found["node_nums"]) for field in fields if "node_nums" in found):
        raise FileError(f"data set {number + 1} (type {kind}) ends within a node; it is damaged")
    return found


def _check_function(found: dict[str, Any], number: int) -> None:
    """Holds the data against the count in the header: pyuff takes what there is."""
    where = f"data set {number + 1} (type 58)"
    if found["binary"] and found.get("fp_format") != IEEE:
        raise FileError(
            f"{where} has floating-point format {found.get('fp_format')}; expected {IEEE} (IEEE 754)"
        )
    if found["ord_data_type"] not in (2, 4, 5, 6):
        raise FileError(f"{where} has ordinate data type {found['ord_data_type']}; expected 2, 4, 5 or 6")
    n, stated = len(found["data"]), int(found["num_pts"])
    if n < stated:
        raise FileError(f"{where} has {n} values; its header promises {stated}")
    # Programs fill the last line with zeros, or end binary data with a line break.
    found["data"] = found["data"][:stated]
    found["x"] = np.asarray(found["x"])[:stated]
    if stated < 1:
        raise FileError(f"{where} has no values")
