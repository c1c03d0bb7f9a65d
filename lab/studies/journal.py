"""The journal of a study: one line per finished run, written at once, so that no way to die loses any.

The first line says what the study is; every other line is the outcome of one run. A line that was cut short by a kill is
the last one, and is dropped. The journal is kept: `study.h5` is made from it.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np

from lab.errors import FileError, StudyError
from lab.files.checksum import sha256_of
from lab.scenario import make_scenario
from lab.studies.axes import changed
from lab.studies.plan import Study

NAME = "study.jsonl"
FORMAT = "modal-study-journal"
VERSION = 1
SYNC_SECONDS = 1.0
"""A power cut loses at most what was finished in this time; a kill loses nothing."""


def header(study: Study) -> dict[str, Any]:
    """What decides the outcomes of a study."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "scenario": study.scenario,
        "models": _models(study),
        "vary": [
            {"paths": list(axis.paths), "values": [list(each) for each in axis.values]} for axis in study.axes
        ],
        "repeats": study.repeats,
        "seed": study.seed,
        "paired": study.paired,
        "collect": dict(study.collect),
    }


def create(path: Path, study: Study, known: Iterable[dict[str, Any]] = ()) -> None:
    """Writes a journal with the outcomes already known; an older one is replaced once the new one is whole."""
    hidden = path.with_name(f".{path.name}.part")
    with hidden.open("wb") as file:
        file.write(_line(header(study)))
        for outcome in known:
            file.write(_line(outcome))
        file.flush()
        os.fsync(file.fileno())
    os.replace(hidden, path)


def read_header(path: Path) -> dict[str, Any]:
    """The first line.

    Raises:
        FileError: not a journal.
    """
    with path.open("rb") as file:
        try:
            told = json.loads(file.readline())
        except ValueError:
            told = None
    if not isinstance(told, dict) or (told.get("format"), told.get("version")) != (FORMAT, VERSION):
        raise FileError(
            f"{path}: is no journal of a study; choose another --out or add --force to start afresh"
        )
    return told


def outcomes(path: Path) -> Iterator[dict[str, Any]]:
    """The finished runs, in the order in which they finished.

    Raises:
        FileError: a line that was not written by a study.
    """
    with path.open("rb") as file:
        file.readline()
        for number, line in enumerate(file, start=2):
            if not line.endswith(b"\n"):
                return
            try:
                yield json.loads(line)
            except ValueError:
                raise FileError(
                    f"{path}: line {number} is damaged; delete that line, and its run is done again"
                ) from None


class Journal:
    """A journal open for more outcomes, and for nobody else."""

    def __init__(self, path: Path) -> None:
        self.file: BinaryIO = path.open("r+b")
        self.synced = time.monotonic()
        try:
            _lock(self.file, path)
        except FileError:
            self.file.close()
            raise

    def __enter__(self) -> Journal:
        # What a kill cut short is written again.
        size = self.file.seek(0, os.SEEK_END)
        self.file.truncate(_whole(self.file, size))
        self.file.seek(0, os.SEEK_END)
        return self

    def write(self, lines: Sequence[str]) -> None:
        """Adds lines of JSON, on disk when this returns."""
        self.file.write("".join(f"{line}\n" for line in lines).encode())
        self.file.flush()
        if time.monotonic() - self.synced > SYNC_SECONDS:
            os.fsync(self.file.fileno())
            self.synced = time.monotonic()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.file.close()


def renumbering(old: Mapping[str, Any], study: Study, path: Path) -> Callable[[int], int] | None:
    """From the run numbers of a journal to those of the study that extends it; None where they are the same.

    Args:
        old: first line of the journal.
        study: what is asked now.
        path: of the journal, for complaints.

    Raises:
        StudyError: the study differs in more than further values, further repeats and its title.
    """
    new = json.loads(json.dumps(header(study), default=str))
    if new == old:
        return None
    advice = "choose another --out, or add --force to start afresh"
    for key in ("scenario", "models", "seed", "paired", "collect"):
        if new[key] != old[key]:
            raise StudyError(f"{path}: belongs to a study with another {key}; {advice}")
    if [axis["paths"] for axis in new["vary"]] != [axis["paths"] for axis in old["vary"]]:
        raise StudyError(f"{path}: belongs to a study that varies other keys; {advice}")
    if new["repeats"] < old["repeats"]:
        raise StudyError(
            f"{path}: has {old['repeats']} repeats, the study asks for {new['repeats']}; {advice}"
        )
    moved = [_moved(before, now, path, advice) for before, now in zip(old["vary"], new["vary"], strict=True)]
    shape = [len(steps) for steps in moved]
    n_old = int(np.prod(shape, dtype=int))
    new_shape = [len(axis) for axis in study.axes]

    def renumber(number: int) -> int:
        repeat, point = divmod(number, n_old)
        steps = (
            [steps[k] for steps, k in zip(moved, np.unravel_index(point, shape), strict=True)]
            if shape
            else []
        )
        place = int(np.ravel_multi_index(steps, new_shape)) if shape else 0
        return repeat * study.n_points + place

    return renumber


def _moved(before: Mapping[str, Any], now: Mapping[str, Any], path: Path, advice: str) -> list[int]:
    """Where the steps of an axis are now."""
    at = {json.dumps(step): k for k, step in enumerate(zip(*now["values"], strict=True))}
    gone = [step for step in zip(*before["values"], strict=True) if json.dumps(step) not in at]
    if gone:
        told = ", ".join(
            f"{key} = {json.dumps(value)}" for key, value in zip(before["paths"], gone[0], strict=True)
        )
        raise StudyError(f"{path}: has runs with {told}, which the study leaves out; {advice}")
    return [at[json.dumps(step)] for step in zip(*before["values"], strict=True)]


def _models(study: Study) -> dict[str, str]:
    """SHA-256 of every model that the study names."""
    names = {study.scenario["model"]}
    for axis in study.axes:
        for key, values in zip(axis.paths, axis.values, strict=True):
            names |= set(values) if key == "model" else set()
    found = {}
    for name in sorted(names):
        file = make_scenario(changed(study.scenario, {"model": name}), folder=study.folder).model_file()
        found[name] = sha256_of(file)
    return found


def _line(value: Mapping[str, Any]) -> bytes:
    return (json.dumps(value, default=str) + "\n").encode()


def _whole(file: BinaryIO, size: int) -> int:
    """Up to where the file holds whole lines."""
    end = size
    while end > 0:
        start = max(0, end - 65536)
        file.seek(start)
        found = file.read(end - start).rfind(b"\n")
        if found >= 0:
            return start + found + 1
        end = start
    return 0


def _lock(file: BinaryIO, path: Path) -> None:
    try:
        import fcntl
    except ImportError:
        # Without such locks, as on Windows, keeping two studies apart is up to the user.
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise FileError(
            f"{path}: another study is writing it; wait for it, or choose another --out"
        ) from None
