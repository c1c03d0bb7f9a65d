"""Recording file -> Recording: in SI units, large data left on disk and converted slice by slice."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from identification.errors import RecordingError
from identification.recording import Array, Channel, Record, Recording, Signals
from lab.errors import FileError
from lab.files.recording_writer import FORMAT, RESERVED, VERSION
from lab.files.units import to_si

IN_MEMORY = 256 * 1024**2
"""Data up to this size [bytes] are read at once."""


@dataclass(frozen=True, eq=False)
class DiskSignals:
    """Rows of samples that stay in the file and come out in SI, slice by slice."""

    dataset: Any
    factors: Array

    @property
    def shape(self) -> tuple[int, ...]:
        """(n_channels, n_samples)."""
        return tuple(self.dataset.shape)

    def __getitem__(self, key: Any, /) -> Any:
        """Samples as an array.

        Raises:
            FileError: the file is damaged there.
        """
        try:
            values = np.asarray(self.dataset[key])
        except OSError as error:
            raise FileError(
                f"{self.dataset.file.filename}: cannot read samples ({_first_line(error)})"
            ) from None
        if np.all(self.factors == 1.0):
            return values
        factors = self.factors[key[0] if isinstance(key, tuple) else key]
        return values * np.reshape(factors, np.shape(factors) + (1,) * (values.ndim - np.ndim(factors)))


def load(path: str | Path, *, lazy: bool | None = None) -> Recording:
    """The recording in a file, in SI units.

    Args:
        path: HDF5 file of the layout above.
        lazy: leave the samples on disk and read them when sliced; when None, only those of large files.

    Raises:
        FileError: no such file, not HDF5, truncated, of another format or version, or incomplete.
    """
    path = Path(path)
    with one_line(path):
        file = open_file(path)
        keep_open = False
        try:
            check_format(file)
            size = sum(_data(group, "outputs").size * 8 for group in _groups(file))
            on_disk = size > IN_MEMORY if lazy is None else lazy
            recording = _recording(file, on_disk)
            keep_open = on_disk
        finally:
            if not keep_open:
                file.close()
    return recording


@contextmanager
def one_line(path: Path) -> Iterator[None]:
    """Every fault of a file as one line that names it."""
    try:
        yield
    except (FileError, RecordingError) as error:
        raise FileError(f"{path}: {error}") from None
    except (OSError, RuntimeError, KeyError) as error:
        raise FileError(
            f"{path}: cannot be read ({_first_line(error)}); the file is damaged, write it again"
        ) from None


def open_file(path: Path) -> Any:
    """A recording file open for reading.

    Raises:
        FileError: no such file, or not HDF5.
    """
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise FileError(f"{what}; expected a recording file (HDF5)")
    try:
        readable = h5py.is_hdf5(path)
        with path.open("rb"):
            pass
    except OSError as error:
        raise FileError(f"cannot be opened ({error.strerror})") from None
    if not readable:
        raise FileError(
            "not an HDF5 file; expected a recording file, make one of other formats with: lab import FILE"
        )
    return h5py.File(path, "r", locking="best-effort")


def check_format(file: Any) -> None:
    """Makes sure that a file is a recording file of a version that can be read.

    Raises:
        FileError: it is not.
    """
    form, version = _text(file.attrs.get("format")), file.attrs.get("version")
    if form != FORMAT:
        raise FileError(
            f"format is {form or 'not given'!r}; expected {FORMAT!r} in the attributes of the file"
        )
    if version != VERSION:
        raise FileError(f"version is {version}; this lab reads version {VERSION}")


def _groups(file: Any) -> list[Any]:
    records = file.get("records")
    names = (
        sorted((name for name in records if name.isdigit()), key=int)
        if isinstance(records, h5py.Group)
        else []
    )
    if not names and "frequency_responses" in file:
        raise FileError(
            "holds frequency responses and no samples; expected groups /records/0, /records/1, …; lab identify and "
            "lab diagnose take the responses, and so does lab.load_responses in Python"
        )
    if not names:
        raise FileError("holds no record; expected groups /records/0, /records/1, …")
    return [records[name] for name in sorted(names, key=int)]


def _data(group: Any, side: str) -> Any:
    data = group.get(side)
    if not isinstance(data, h5py.Dataset):
        raise FileError(f"{group.name} has no dataset {side!r}; expected (n_channels, n_samples)")
    if data.ndim != 2 or data.dtype.kind not in "fiu":
        raise FileError(
            f"{data.name} has shape {data.shape} of {data.dtype}; expected numbers (n_channels, n_samples)"
        )
    return data


def _recording(file: Any, lazy: bool) -> Recording:
    groups = _groups(file)
    outputs = _channels(_data(groups[0], "outputs"))
    inputs: tuple[Channel, ...] = ()
    records = []
    for group in groups:
        if "inputs" in group:
            found = _channels(_data(group, "inputs"))
            inputs = inputs or found
            _same(inputs, found, f"{group.name}/inputs")
        _same(outputs, _channels(_data(group, "outputs")), f"{group.name}/outputs")
        records.append(_record(group, lazy))
    rates = {_number(group, "sample_rate") for group in groups}
    if len(rates) > 1:
        raise FileError(f"records have sample rates {sorted(rates)}; expected one rate in a file")
    title, source = (_text(file.attrs.get(name)) for name in ("title", "source"))
    return Recording(tuple(records), inputs, outputs, rates.pop(), title, source, _free(file))


def _record(group: Any, lazy: bool) -> Record:
    outputs = _signals(_data(group, "outputs"), lazy)
    # A run without measured forces may leave the data set out or give it no rows, of any length.
    none: Signals = np.zeros((0, outputs.shape[1]))
    driven = "inputs" in group and _data(group, "inputs").shape[0]
    return Record(
        _text(_need(group, "kind")),
        _signals(_data(group, "inputs"), lazy) if driven else none,
        outputs,
        _text(group.attrs.get("start_time")),
        _text(group.attrs.get("note")),
        _free(group),
    )


def _signals(data: Any, lazy: bool) -> Signals:
    factors = np.array([to_si(unit)[1] for unit in _texts(data, "units")])
    signals = DiskSignals(data, factors)
    return signals if lazy else np.asarray(signals[:, :], dtype=np.float64)


def _channels(data: Any) -> tuple[Channel, ...]:
    names, units = _texts(data, "names"), _texts(data, "units")
    dofs = _texts(data, "dofs") if "dofs" in data.attrs else [""] * len(names)
    factors = np.atleast_1d(data.attrs.get("factors", np.ones(len(names))))
    if factors.dtype.kind not in "fiu":
        raise FileError(f"{data.name} has factors of type {factors.dtype}; expected one number per channel")
    rows = data.shape[0]
    lengths = {"units": len(units), "dofs": len(dofs), "factors": factors.size, "rows": rows or len(names)}
    for what, length in lengths.items():
        if length != len(names):
            raise FileError(
                f"{data.name} has {len(names)} names and {length} {what}; expected one per channel, time last"
            )
    return tuple(
        Channel(name, to_si(unit)[0], dof, float(factor))
        for name, unit, dof, factor in zip(names, units, dofs, factors, strict=True)
    )


def _same(expected: tuple[Channel, ...], found: tuple[Channel, ...], where: str) -> None:
    if found and found != expected:
        raise FileError(f"{where} has other channels than the records before; expected the same in all")


def _need(group: Any, name: str) -> Any:
    if name not in group.attrs:
        raise FileError(f"{group.name} has no attribute {name!r}")
    return group.attrs[name]


def _number(group: Any, name: str) -> float:
    value = np.asarray(_need(group, name))
    if value.ndim or value.dtype.kind not in "fiu":
        raise FileError(f"{group.name} has {name} = {value}; expected a number")
    return float(value)


def _free(group: Any) -> dict[str, str | float]:
    """The attributes without a field of their own, as text and numbers; arrays are left out."""
    free: dict[str, str | float] = {}
    for name, value in group.attrs.items():
        if name in RESERVED:
            continue
        if isinstance(value, str | bytes):
            free[name] = _text(value)
        elif np.ndim(value) == 0 and np.asarray(value).dtype.kind in "fiub":
            free[name] = float(value)
    return free


def _text(value: Any) -> str:
    return "" if value is None else value.decode() if isinstance(value, bytes) else str(value)


def _texts(data: Any, name: str) -> list[str]:
    if name not in data.attrs:
        raise FileError(f"{data.name} has no attribute {name!r}; expected one text per channel")
    return [_text(value) for value in np.atleast_1d(data.attrs[name])]


def _first_line(error: Exception) -> str:
    return " ".join(str(error).split())
