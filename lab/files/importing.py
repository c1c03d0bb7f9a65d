"""Foreign files -> recording file: readers by suffix, a recipe for what the files leave open."""

from __future__ import annotations

import os
import re
import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from identification.modes import Modes
from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.errors import FileError
from lab.files.arrays import read_json, read_numpy
from lab.files.importing_columns import AmbiguousFileError, Source, source_hash
from lab.files.importing_records import recording_of
from lab.files.importing_responses import responses_of
from lab.files.matlab import read_matlab
from lab.files.recipe import Recipe
from lab.files.recipe_start import starting_recipe
from lab.files.recording_geometry import Geometry, add_geometry
from lab.files.recording_responses import save_responses
from lab.files.recording_writer import save
from lab.files.table import read_table
from lab.files.uff import UniversalFile, read_uff

UNIVERSAL = (".uff", ".unv", ".ufb", ".bunv", ".uf")

READERS: dict[str, Callable[[Path, Recipe], Source]] = {
    ".mat": lambda path, recipe: read_matlab(path, recipe.arrays),
    ".npy": lambda path, recipe: read_numpy(path, recipe.arrays),
    ".npz": lambda path, recipe: read_numpy(path, recipe.arrays),
    ".json": lambda path, recipe: read_json(path, recipe.arrays),
    **{
        suffix: lambda path, recipe: read_table(path, recipe.table)
        for suffix in (".csv", ".tsv", ".txt", ".dat", ".asc", ".tab")
    },
}
"""Suffix: reader of columns; text tables may be packed, as in .csv.gz."""


@dataclass(frozen=True, eq=False)
class Imported:
    """What foreign files held.

    Attributes:
        recording: time signals, or None.
        response: frequency responses, or None.
        modes: or None.
        geometry: or None.
        facts: attributes that say where it all comes from.
        notes: what was left out or settled, one sentence each.
    """

    recording: Recording | None
    response: FrequencyResponse | None
    modes: Modes | None
    geometry: Geometry | None
    facts: dict[str, str | float]
    notes: tuple[str, ...]


def read_foreign(path: str | Path, recipe: Recipe | None = None, *, kind: str | None = None) -> Imported:
    """What a foreign file, or a folder of them, holds, in SI units.

    Args:
        path: file in one of the formats of `READERS` or a universal file, or a folder of such files.
        recipe: what columns mean; universal files may do without.
        kind: what drove the structure, for records that state none; "other" when nothing says it.

    Raises:
        AmbiguousFileError: the file leaves a unit, the rate or the meaning of columns open.
        FileError: it cannot be read, or contradicts itself or the recipe.
    """
    path = Path(path)
    chosen = recipe or Recipe()
    files = _files(path, chosen)
    try:
        contents = [_read(file, chosen, many=len(files) > 1) for file in files]
        imported = _made(path, contents, chosen, kind)
    except AmbiguousFileError as error:
        raise AmbiguousFileError(f"{path}: {error}", error.recipe) from None
    except FileError as error:
        raise FileError(f"{path}: {error}") from None
    facts: dict[str, str | float] = {"source_file": path.resolve().name, "source_sha256": source_hash(files)}
    if chosen.text:
        facts["recipe"] = chosen.text
    recording = imported.recording
    if recording is not None:
        recording = replace(recording, attributes=facts, source=recording.source or path.resolve().name)
    return replace(imported, recording=recording, facts=facts)


def save_imported(imported: Imported, path: str | Path, *, title: str = "", source: str = "") -> None:
    """Writes what was imported as a recording file; an existing one is replaced once the new one is whole.

    Raises:
        FileError: there are neither samples nor responses, or the file cannot be written.
    """
    path = Path(path)
    if imported.recording is None and imported.response is None:
        raise FileError(f"{path}: nothing to write: neither time signals nor frequency responses")
    hidden = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")
    try:
        if imported.response is not None:
            save_responses(
                imported.response,
                hidden,
                recording=imported.recording,
                title=title,
                source=source or str(imported.facts.get("source_file", "")),
                attributes=imported.facts,
            )
        elif imported.recording is not None:
            save(imported.recording, hidden)
        if imported.geometry is not None:
            add_geometry(imported.geometry, hidden)
        os.replace(hidden, path)
    except (OSError, FileError) as error:
        reason = getattr(error, "strerror", None) or "no such folder, or no right to write there"
        raise FileError(f"{path}: cannot be written ({reason}); choose another --out") from None
    finally:
        hidden.unlink(missing_ok=True)


def _files(path: Path, recipe: Recipe) -> list[Path]:
    if path.is_file():
        if recipe.blocks is not None:
            raise FileError(f"{path}: is a file; [blocks] in the recipe expects a folder")
        return [path]
    if not path.is_dir():
        raise FileError(f"{path}: no such file; expected a file or folder to import")
    if recipe.blocks is None:
        listed = sorted(each.name for each in path.iterdir() if each.is_file())[:6]
        raise AmbiguousFileError(
            f'{path}: is a folder; expected a recipe with [blocks] files = "…" and stack = "time" or "records"',
            _folder_recipe(path, listed),
        )
    # A pattern that climbs out of the folder would read what nobody named.
    if ".." in Path(recipe.blocks.files).parts or Path(recipe.blocks.files).is_absolute():
        raise FileError(
            f"{path}: files = {recipe.blocks.files!r} leaves the folder; expected a pattern in it"
        )
    files = sorted((each for each in path.glob(recipe.blocks.files) if each.is_file()), key=_natural)
    if not files:
        held = sorted(each.name for each in path.iterdir())[:8]
        raise FileError(
            f"{path}: no file matches {recipe.blocks.files!r}; there are {', '.join(held) or 'none'}"
        )
    return files


def _folder_recipe(path: Path, names: Sequence[str]) -> str:
    start = '[blocks]\nfiles = "?"  # a pattern, such as data*.txt\nstack = "?"  # "time" or "records"\n'
    for name in names:
        try:
            first = _read(path / name, Recipe(), many=True)
        except FileError:
            continue
        if isinstance(first, Source):
            head, _, body = starting_recipe(first).partition("\n\n")
            # Keys at the top must stand before the first table.
            top, bracket, tables = body.partition("\n[")
            return f"{head}\n\n{top}\n{start}{bracket}{tables}"
    listed = "".join(f"#   {name}\n" for name in names)
    return f"# {path.name} holds:\n{listed}\n{start}"


def _natural(path: Path) -> list[tuple[int, int, str]]:
    """Order of names in which data2 comes before data10."""
    parts = re.split(r"(\d+)", path.as_posix())
    return [(1, int(part), "") if part.isdecimal() else (0, 0, part) for part in parts]


def _read(path: Path, recipe: Recipe, *, many: bool) -> Source | UniversalFile:
    suffixes = [suffix.lower() for suffix in path.suffixes]
    if suffixes and suffixes[-1] == ".gz":
        suffixes.pop()
    suffix = suffixes[-1] if suffixes else ""
    try:
        if suffix in UNIVERSAL:
            return read_uff(path, recipe)
        if suffix not in READERS:
            known = ", ".join([*UNIVERSAL, *READERS])
            raise FileError(f"suffix {suffix!r} is unknown; expected one of {known}")
        return READERS[suffix](path, recipe)
    except FileError as error:
        raise FileError(f"{path.name}: {error}" if many else str(error)) from None


def _made(
    path: Path, contents: Sequence[Source | UniversalFile], recipe: Recipe, kind: str | None
) -> Imported:
    universal = [each for each in contents if isinstance(each, UniversalFile)]
    sources: list[Source] = []
    for each in contents:
        sources += each.sources if isinstance(each, UniversalFile) else [each]
    notes = [note for each in universal for note in each.notes]
    if recipe.responses:
        return Imported(None, responses_of(sources, recipe), None, None, {}, tuple(notes))
    first = _single(universal)
    recording = None
    if sources and not (first and first.response and not _wanted(sources[0], recipe)):
        joined = recipe.blocks is None or recipe.blocks.stack == "time"
        recording = recording_of(
            sources, recipe, kind or "other", joined=joined and (not universal or recipe.blocks is not None)
        )
        if not recording.title and first is not None:
            recording = replace(recording, title=first.title)
        if any(record.kind == "other" for record in recording.records) and (kind or recipe.kind) is None:
            notes.append('nothing says what drove the structure, so its kind is "other"; --kind states it')
        _unused(sources[0], recipe, notes)
    parts: dict[str, Any] = {"response": None, "modes": None, "geometry": None}
    if first is not None:
        parts = {name: getattr(first, name) for name in parts}
    if recording is None and parts["response"] is None and parts["modes"] is None:
        raise FileError("holds neither time signals nor frequency responses nor modes; nothing to import")
    return Imported(recording, facts={}, notes=tuple(notes), **parts)


def _single(universal: Sequence[UniversalFile]) -> UniversalFile | None:
    if len(universal) > 1 and any(each.response or each.modes for each in universal):
        raise FileError("several universal files hold responses or modes; import them one by one")
    return universal[0] if universal else None


def _wanted(source: Source, recipe: Recipe) -> bool:
    """Whether a recipe that names channels names any of the time signals."""
    parts = [*recipe.inputs, *recipe.outputs]
    return not parts or any(str(part.column or part.name) in source.columns for part in parts)


def _unused(source: Source, recipe: Recipe, notes: list[str]) -> None:
    """Notes columns that the recipe leaves out: nothing gets lost unsaid."""
    parts = [*recipe.inputs, *recipe.outputs]
    if not parts:
        return
    used = {source.key(part.name if part.column is None else part.column) for part in parts}
    used |= {source.key(column) for column in (recipe.time, recipe.record) if column is not None}
    rest = [name for name in source.columns if name not in used]
    if rest:
        notes.append(f"column(s) left out: {', '.join(rest[:12])}{' …' if len(rest) > 12 else ''}")
