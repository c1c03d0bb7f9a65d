"""MATLAB files, v4 to v7 and v7.3: their variables as columns, and matrices written for MATLAB."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from lab.errors import FileError
from lab.files.arrays import as_source
from lab.files.importing_columns import Source
from lab.files.recipe_parts import ArraysPart


def read_matlab(path: Path, part: ArraysPart) -> Source:
    """The columns of a MATLAB file; fields of structures are named data.acceleration.

    Raises:
        FileError: not a MATLAB file, or damaged.
    """
    variables = _version_73(path) if h5py.is_hdf5(path) else _version_5(path)
    return as_source(path, variables, part)


def write_matlab(path: Path, variables: Mapping[str, Any]) -> None:
    """Writes variables to a MATLAB file (v5): arrays as matrices, lists of texts as cell arrays."""
    shaped = {
        name: np.array(value, dtype=object)[:, None] if isinstance(value, list | tuple) else value
        for name, value in variables.items()
    }
    scipy.io.savemat(path, shaped, format="5", oned_as="column")


def _version_5(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            loaded = scipy.io.loadmat(file, simplify_cells=True)
    except Exception as error:  # the reader of damaged files raises almost anything
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"cannot be read as a MATLAB file ({reason[:100]})") from None
    return {name: value for name, value in loaded.items() if not name.startswith("__")}


def _version_73(path: Path) -> dict[str, Any]:
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            return _variables(file)
    except Exception as error:  # so does this one
        raise FileError(f"cannot be read as a MATLAB file ({' '.join(str(error).split())[:100]})") from None


def _variables(group: Any) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, item in group.items():
        if name.startswith("#"):
            continue
        if isinstance(item, h5py.Group):
            found[name] = _variables(item)
        elif "MATLAB_empty" not in item.attrs:
            found[name] = _value(item)
    return found


def _value(item: Any) -> Any:
    """A data set as MATLAB shows it: the axes are stored in reverse."""
    values = np.asarray(item[()])
    if item.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, values.T.ravel()))
    if values.dtype.names == ("real", "imag"):
        values = values["real"] + 1j * values["imag"]
    return values.T
