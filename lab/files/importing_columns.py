"""What a file of columns holds before a recipe says what it means, and the error of a file that leaves it open."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lab.errors import FileError


class AmbiguousFileError(FileError):
    """A file that does not say all that a recording needs.

    Attributes:
        recipe: what the file shows, as comments, and a recipe to start from (TOML).
    """

    def __init__(self, message: str, recipe: str) -> None:
        super().__init__(message)
        self.recipe = recipe


@dataclass(frozen=True, eq=False)
class Source:
    """Columns of one file, as they are written there.

    Attributes:
        path: the file.
        columns: readings by name, each of shape (n_rows,), real or complex.
        units: units that the file states, by name of the column.
        scalars: single numbers that the file holds, by name.
        unclear: arrays that only a recipe can take apart, by name: their shapes.
        named: whether the names come from the file or the recipe, rather than from the order.
        preview: its first lines or its variables.
        sides: "input" or "output" of the columns that the file itself tells apart, by name.
        sample_rate: that the file states [Hz]; 0 when it does not.
        kind, start_time, note: of the record, where the file states them.
    """

    path: Path
    columns: Mapping[str, Any]
    units: Mapping[str, str] = field(default_factory=dict)
    scalars: Mapping[str, float] = field(default_factory=dict)
    unclear: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    named: bool = True
    preview: tuple[str, ...] = ()
    sides: Mapping[str, str] = field(default_factory=dict)
    sample_rate: float = 0.0
    kind: str = ""
    start_time: str = ""
    note: str = ""

    def key(self, column: str | int) -> str:
        """Name of a column given by name, or by its number from 1.

        Raises:
            FileError: there is none; names those that exist.
        """
        names = list(self.columns)
        if isinstance(column, int):
            if 1 <= column <= len(names):
                return names[column - 1]
            raise FileError(f"column {column} does not exist; the file has {len(names)}, counted from 1")
        if column in self.columns:
            return column
        base = column.partition("[")[0]
        if base in self.unclear:
            raise FileError(
                f"variable {base!r} has shape {self.unclear[base]}; say in [arrays] whether samples = "
                f'"rows" or "columns", and call its columns {base}[1], {base}[2], …'
            )
        raise FileError(f"column {column!r} does not exist; there are {_listed(names)}")

    def real(self, column: str | int) -> np.ndarray:
        """Readings of a column as real numbers, shape (n_rows,); missing ones are NaN.

        Raises:
            FileError: no such column, or its readings are complex or infinite.
        """
        name = self.key(column)
        values = np.asarray(self.columns[name])
        if values.dtype.kind == "c":
            raise FileError(f"column {name!r} is complex; expected real samples")
        values = values.astype(np.float64)
        if np.isinf(values).any():
            first = int(np.argmax(np.isinf(values)))
            raise FileError(f"column {name!r} is infinite at row {first + 1}; mark missing samples as NaN")
        return values


def source_hash(paths: list[Path]) -> str:
    """SHA-256 of the files one after another, in hexadecimal.

    Raises:
        FileError: a file cannot be read.
    """
    total = hashlib.sha256()
    for path in paths:
        try:
            with path.open("rb") as file:
                while piece := file.read(1 << 20):
                    total.update(piece)
        except OSError as error:
            raise FileError(f"{path}: cannot be read ({error.strerror})") from None
    return total.hexdigest()


def _listed(names: list[str], most: int = 12) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) + more) or "none"
