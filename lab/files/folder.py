"""An output folder that is whole or absent."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lab.errors import FileError

OUTPUTS = {
    "recording.h5",
    "result.json",
    "report.html",
    "run.rrd",
    "diagnosis",
    "diagnosis.json",
    "extended.xml",
    "placement.json",
    "study.h5",
    "study.jsonl",
}
"""What the lab writes into an output folder; `force` replaces a folder only when nothing else is in it."""


@contextmanager
def output_folder(path: str | Path, *, force: bool = False) -> Iterator[Path]:
    """A hidden folder to write into: it takes the name `path` when the block ends well, or vanishes.

    Args:
        path: folder to come; missing parents are made.
        force: replace an earlier output of the lab there.

    Raises:
        FileError: the folder holds something, or cannot be made.
    """
    target = Path(path)
    final = target.resolve()
    _check_free(target, final, force)
    made: list[Path] = []
    hidden = final.with_name(f".{final.name}.{uuid.uuid4().hex[:8]}.part")
    try:
        try:
            _make_parents(final.parent, made)
            hidden.mkdir()
        except OSError as error:
            raise FileError(f"{target}: cannot be made ({error.strerror}); choose another --out") from None
        yield hidden
        try:
            _swap(hidden, final)
        except OSError as error:
            raise FileError(f"{target}: cannot be written ({error.strerror}); choose another --out") from None
    except BaseException:
        shutil.rmtree(hidden, ignore_errors=True)
        for parent in reversed(made):
            with suppress(OSError):
                parent.rmdir()
        raise


def _check_free(target: Path, final: Path, force: bool) -> None:
    if not final.exists():
        return
    if not final.is_dir():
        raise FileError(f"{target}: is a file; expected a folder to write into, choose another --out")
    try:
        held = sorted(os.listdir(final))
    except OSError as error:
        raise FileError(f"{target}: cannot be read ({error.strerror}); choose another --out") from None
    if held and not force:
        raise FileError(f"{target}: exists already; choose another --out or add --force to replace it")
    foreign = [name for name in held if name not in OUTPUTS]
    if foreign:
        raise FileError(
            f"{target}: holds {foreign[0]!r}, which the lab did not write, so --force does not replace it; "
            "choose another --out"
        )
    if Path.cwd().is_relative_to(final):
        raise FileError(f"{target}: is the working folder; choose a folder of its own with --out")


def _make_parents(folder: Path, made: list[Path]) -> None:
    if not folder.exists():
        _make_parents(folder.parent, made)
        folder.mkdir()
        made.append(folder)


def _swap(new: Path, final: Path) -> None:
    """Give `new` the name `final`; what was there is put back when that fails."""
    if not final.exists():
        new.rename(final)
        return
    old = final.with_name(f".{final.name}.{uuid.uuid4().hex[:8]}.old")
    final.rename(old)
    try:
        new.rename(final)
    except BaseException:
        old.rename(final)
        raise
    shutil.rmtree(old, ignore_errors=True)
