"""NumPy and JSON files -> columns: vectors as they are, matrices once a recipe says where time runs."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lab.errors import FileError
from lab.files.importing_columns import Source
from lab.files.recipe_parts import ArraysPart


def read_numpy(path: Path, part: ArraysPart) -> Source:
    """The columns of an .npy or .npz file; the array of an .npy file is called "array".

    Raises:
        FileError: not such a file, damaged, or an array of objects, which would run foreign code.
    """
    try:
        with path.open("rb") as file:
            loaded = np.load(file, allow_pickle=False)
            bare = isinstance(loaded, np.ndarray)
            variables = {"array": loaded} if bare else {name: loaded[name] for name in loaded.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise FileError(f"cannot be read as a NumPy file ({_short(error)})") from None
    return as_source(path, variables, part)


def read_json(path: Path, part: ArraysPart) -> Source:
    """The columns of a JSON file; names of nested tables are joined by dots.

    Raises:
        FileError: not JSON, or rows of different lengths.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise FileError(f"cannot be read as JSON ({_short(error)})") from None
    if not isinstance(document, dict):
        document = {"array": document}
    return as_source(path, document, part)


def as_source(path: Path, variables: Mapping[str, Any], part: ArraysPart) -> Source:
    """Columns of named arrays.

    A vector is one column. A matrix `data` becomes data[1], data[2], … once `part` says whether its rows or
    its columns are samples. Single numbers are kept apart; texts are left out.
    """
    columns: dict[str, np.ndarray] = {}
    scalars: dict[str, float] = {}
    unclear: dict[str, tuple[int, ...]] = {}
    preview = []
    for name, value in _flat(variables):
        array = _array(value)
        if array is None:
            preview.append(f"{name} = {_short(value)}")
            continue
        if array.size == 1:
            if array.dtype.kind != "c":
                scalars[name] = float(array.reshape(()))
            preview.append(f"{name} = {array.reshape(())}")
            continue
        preview.append(f"{name}: {' x '.join(map(str, array.shape))} {array.dtype}")
        vector = np.squeeze(array)
        if vector.ndim == 1:
            columns[name] = vector
        elif array.ndim == 2 and part.samples:
            rows = array if part.samples == "columns" else array.T
            columns |= {f"{name}[{k}]": row for k, row in enumerate(rows, 1)}
        elif array.size:
            unclear[name] = array.shape
    return Source(path, columns, {}, scalars, unclear, named=True, preview=tuple(preview[:40]))


def _flat(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value


def _array(value: Any) -> np.ndarray | None:
    """The value as an array of numbers, or None for texts and ragged lists."""
    if isinstance(value, list) and value and None in value:
        value = [np.nan if item is None else item for item in value]
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    return array if array.dtype.kind in "fiubc" and array.size else None


def _short(value: object) -> str:
    text = " ".join(str(value).split())
    return text if len(text) <= 80 else text[:77] + "…"
