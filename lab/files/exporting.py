"""Recordings and results -> files of other programs: universal files, MATLAB, Matrix Market, CSV."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lab.errors import FileError
from lab.files.exporting_arrays import matrix_market, write_csv, write_data_mat, write_result_mat
from lab.files.exporting_source import Given
from lab.files.exporting_uff import write_data_uff, write_modes_uff

if TYPE_CHECKING:
    from collections.abc import Iterator

PARTS = ("modes", "data", "matrices")
"""What can be exported."""


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes:
        path: the file.
        what: one of `PARTS`.
        notes: what was left out, one sentence each.
    """

    path: Path
    what: str
    notes: tuple[str, ...]


def export_file(
    source: str | Path,
    to: str | Path,
    *,
    what: str | None = None,
    recording: str | Path | None = None,
    model: str | None = None,
    points: str | Path | None = None,
    text: bool = False,
) -> Exported:
    """Writes a recording, its frequency responses, modes or matrices for another program.

    Args:
        source: output folder of the lab, recording file (.h5) or result (.json).
        to: file to write: .uff or .unv (modes, data), .mat (matrices, modes, data), .mtx (called M, C or K), .csv (data).
        what: "modes", "data" or "matrices"; told by `source` and the name of `to` where it can be.
        recording: recording that says in which units the channels of a result measure.
        model: MJCF file that tells where the channels of a universal file are.
        points: TOML file that tells it.
        text: signals of a universal file as text of 13 digits instead of binary numbers.

    Raises:
        FileError: no such source, nothing of that kind in it, a format that cannot hold it.
    """
    to = Path(to)
    given = _given(Path(source), recording, model, points)
    writer, chosen = _writer(to, given, what)
    with _whole(to) as hidden:
        notes = writer(given, hidden, text=text)
    return Exported(to, chosen, tuple(notes))


def _given(source: Path, recording: str | Path | None, model: str | None, points: str | Path | None) -> Given:
    extra = None if recording is None else Path(recording)
    more = (model, None if points is None else Path(points))
    if source.is_dir():
        record, result = source / "recording.h5", source / "result.json"
        if not record.exists() and not result.exists():
            raise FileError(f"{source}: holds neither recording.h5 nor result.json; nothing to export")
        return Given(
            extra or (record if record.exists() else None), result if result.exists() else None, *more
        )
    if not source.is_file():
        raise FileError(f"{source}: no such file; expected a folder of the lab, a recording or a result")
    if source.suffix == ".json":
        beside = source.with_name("recording.h5")
        return Given(extra or (beside if beside.exists() else None), source, *more)
    return Given(source, None, *more)


Writer = Callable[..., list[str]]


def _writer(to: Path, given: Given, what: str | None) -> tuple[Writer, str]:
    writers: dict[tuple[str, str], Writer] = {
        (".uff", "modes"): write_modes_uff,
        (".uff", "data"): write_data_uff,
        (".mat", "matrices"): write_result_mat,
        (".mat", "modes"): write_result_mat,
        (".mat", "data"): write_data_mat,
        (".mtx", "matrices"): matrix_market(to.stem),
        (".csv", "data"): write_csv,
    }
    suffix = ".uff" if to.suffix.lower() == ".unv" else to.suffix.lower()
    able = [part for form, part in writers if form == suffix]
    if not able:
        raise FileError(f"{to}: suffix {to.suffix!r} is unknown; expected .uff, .unv, .mat, .mtx or .csv")
    there = [part for part in able if given.recording is not None or part != "data"]
    there = [part for part in there if given.result is not None or part == "data"]
    named = what or (to.stem if to.stem in PARTS else None)
    if named is not None:
        if named not in able:
            raise FileError(f"{to}: {named} cannot be written as {to.suffix}; that holds {' or '.join(able)}")
        if named not in there:
            raise FileError(f"{to}: the source holds no {named}; it holds {' or '.join(there) or 'neither'}")
        return writers[suffix, named], named
    distinct = {writers[suffix, part] for part in there}
    if not distinct:
        raise FileError(f"{to}: {to.suffix} holds {' or '.join(able)}, and the source has none of it")
    if len(distinct) > 1:
        raise FileError(f"{to}: the source holds {' and '.join(there)}; say which with --what")
    return writers[suffix, there[0]], there[0]


@contextmanager
def _whole(path: Path) -> Iterator[Path]:
    """A hidden file beside `path` that takes its name once whole, or vanishes."""
    hidden = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}.part{path.suffix}")
    try:
        yield hidden
        os.replace(hidden, path)
    except OSError as error:
        raise FileError(f"{path}: cannot be written ({error.strerror}); choose another --to") from None
    finally:
        with suppress(OSError):
            hidden.unlink(missing_ok=True)
