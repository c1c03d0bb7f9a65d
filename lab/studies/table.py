"""Journal -> study.h5: one row per run, read and written block by block."""

from __future__ import annotations

import json
import os
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from identification.recording import Array
from lab.studies import journal
from lab.studies.plan import Study

FORMAT = "modal-study"
VERSION = 1
BLOCK = 4096
"""Rows read or written at a time."""
MAX_BUFFERED = 4 * BLOCK
MAX_ERRORS = 20
OWN = ("seed", "seconds", "error")


@dataclass
class Columns:
    """What the outcomes of a study hold.

    Attributes:
        width: of each column of numbers; 0 stands for one number per run.
        texts: names of the columns of text.
        errors: how many runs failed with each error, of the first so many different ones.
        n_failed: how many failed at all.
        present: names of the columns where some run has something.
    """

    width: dict[str, int] = field(default_factory=dict)
    texts: set[str] = field(default_factory=set)
    errors: Counter[str] = field(default_factory=Counter)
    n_failed: int = 0
    present: set[str] = field(default_factory=set)


def flat(outcome: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Names of columns and what a run has to put there; what is collected has names of its own."""
    for name, value in outcome.get("score", {}).items():
        if name == "collected":
            yield from ((f"collected/{own}", each) for own, each in value.items())
        else:
            yield name, value


def columns_of(path: Path) -> Columns:
    """The columns that it takes to hold the outcomes of a journal."""
    columns = Columns()
    for outcome in journal.outcomes(path):
        if "error" in outcome:
            columns.n_failed += 1
            if outcome["error"] in columns.errors or len(columns.errors) < MAX_ERRORS:
                columns.errors[outcome["error"]] += 1
        for name, value in flat(outcome):
            if value is not None:
                columns.present.add(name)
            if isinstance(value, str):
                columns.texts.add(name)
                columns.width.pop(name, None)
            elif name not in columns.texts:
                width = len(value) if isinstance(value, list) else 0
                columns.width[name] = max(width, columns.width.get(name, 0))
    return columns


def write_table(path: Path, study: Study, source: Path, columns: Columns) -> None:
    """Writes the outcomes of a journal as HDF5; an older file is replaced once the new one is whole.

    The group runs has a row per run: point, repeat, seed, seconds, error (empty where there was none) and a dataset per
    column, of shape (n_runs,) or (n_runs, n_values). NaN, or an empty text, stands where a run has nothing to say.
    The group points has a row per point: a dataset per varied key, as numbers, or as JSON where they are none.
    """
    hidden = path.with_name(f".{path.name}.part")
    with h5py.File(hidden, "w") as file:
        file.attrs.update({"format": FORMAT, "version": VERSION, "title": study.title})
        file.attrs.update({"study": study.text, "scenario": study.scenario_text})
        _write_points(file.create_group("points"), study)
        runs = file.create_group("runs")
        _make(runs, study, columns)
        for first, rows in _blocks(source):
            _write_rows(runs, first, rows)
    os.replace(hidden, path)


def blocks(file: h5py.File, name: str) -> Iterator[tuple[Array, Array]]:
    """Points (n,) and the values (n, n_values) of a column, block by block."""
    data = file["runs"][name]
    for first in range(0, len(data), BLOCK):
        values = np.asarray(data[first : first + BLOCK], dtype=float)
        yield file["runs/point"][first : first + BLOCK], values.reshape(len(values), -1)


def _make(runs: h5py.Group, study: Study, columns: Columns) -> None:
    n = study.n_runs
    number = np.arange(n)
    runs["point"], runs["repeat"] = number % study.n_points, number // study.n_points
    runs.create_dataset("seed", n, dtype=np.int64)
    for name, width in {"seconds": 0, **columns.width}.items():
        # An empty list in every run is a column without width.
        shape = (n, width) if width else (n,)
        runs.create_dataset(name, shape, dtype=float, fillvalue=np.nan, chunks=(min(n, BLOCK), *shape[1:]))
    for name in ("error", *sorted(columns.texts)):
        runs.create_dataset(name, (n,), dtype=h5py.string_dtype(), chunks=(min(n, BLOCK),))


def _blocks(source: Path) -> Iterator[tuple[int, list[dict[str, Any]]]]:
    """Outcomes in groups of near numbers; the same block may come again."""
    held: defaultdict[int, list[dict[str, Any]]] = defaultdict(list)
    n_held = 0
    for outcome in journal.outcomes(source):
        held[outcome["run"] // BLOCK].append(outcome)
        n_held += 1
        if n_held >= MAX_BUFFERED:
            fullest = max(held, key=lambda block: len(held[block]))
            rows = held.pop(fullest)
            n_held -= len(rows)
            yield fullest * BLOCK, rows
    for block, rows in sorted(held.items()):
        yield block * BLOCK, rows


def _write_rows(runs: h5py.Group, first: int, rows: list[dict[str, Any]]) -> None:
    places = [row["run"] - first for row in rows]
    values = [{**{name: row.get(name) for name in OWN}, **dict(flat(row))} for row in rows]
    for name in sorted({name for row in values for name in row}):
        data = runs[name]
        block = data[first : first + BLOCK]
        for place, row in zip(places, values, strict=True):
            value = row.get(name)
            if isinstance(value, list):
                if value:
                    block[place, : len(value)] = [np.nan if each is None else each for each in value]
            elif value is not None:
                block[place] = str(value) if block.dtype == object else value
        data[first : first + len(block)] = block


def _write_points(points: h5py.Group, study: Study) -> None:
    index = np.arange(study.n_points)
    steps = np.unravel_index(index, [len(axis) for axis in study.axes]) if study.axes else ()
    for axis, step in zip(study.axes, steps, strict=True):
        for path, values in zip(axis.paths, axis.values, strict=True):
            if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
                points[path] = np.asarray(values)[step]
            else:
                texts = [
                    value if isinstance(value, str) else json.dumps(value, default=str) for value in values
                ]
                points[path] = np.asarray(texts, dtype=object)[step].astype(h5py.string_dtype())
