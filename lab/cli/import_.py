"""`lab import`: measured data in other formats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from lab.cli.colour import coloured
from lab.cli.shared import FILE, example, force_option, json_option, print_json, quiet_option

KINDS = ("pulse", "impact", "random", "burst_random", "sweep", "multisine", "ambient", "free_decay", "other")


@click.command(
    "import",
    short_help="A recording from UFF, MATLAB, CSV, text, NumPy or JSON.",
    epilog=example("lab import my_test.uff --kind random --out my_test.h5"),
)
@click.argument("source", metavar="FILE_OR_FOLDER", type=FILE)
@click.option(
    "--kind", type=click.Choice(KINDS), help="What drove the structure, where nothing else says it."
)
@click.option(
    "--recipe",
    metavar="FILE.toml",
    type=FILE,
    help="What the columns mean: channels, units, rate, which samples to drop.",
)
@click.option(
    "--write-recipe",
    metavar="FILE.toml",
    type=FILE,
    help="Where to put a recipe to start from, when one is needed, instead of printing it.",
)
@click.option("--out", metavar="FILE", type=FILE, help="Recording file to write [default: NAME.h5].")
@force_option
@json_option
@quiet_option
def command(
    source: Path,
    recipe: Path | None,
    kind: str | None,
    write_recipe: Path | None,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """A recording from universal files (UFF), MATLAB, CSV, text, NumPy or JSON, or a folder of them.

    Where a file does not say what its columns mean, a recipe to start from is printed instead. Modes in a
    universal file are written in the form of result.json when --out ends in .json.
    """
    from lab.errors import FileError
    from lab.files.importing import read_foreign, save_imported
    from lab.files.importing_columns import AmbiguousFileError
    from lab.files.importing_modes import save_modes
    from lab.files.recipe import load_recipe

    try:
        imported = read_foreign(source, load_recipe(recipe) if recipe else None, kind=kind)
    except AmbiguousFileError as error:
        if write_recipe is not None:
            _write(write_recipe, error.recipe, force)
            raise FileError(f"{error}; a recipe to start from is in {write_recipe}") from None
        if not as_json:
            click.echo(error.recipe, nl=False)
        raise
    modal = imported.recording is None and imported.response is None
    target = out or Path(source.resolve().name.partition(".")[0] + (".json" if modal else ".h5"))
    if target.exists() and not force:
        raise FileError(f"{target}: exists already; choose another --out or add --force to replace it")
    notes = list(imported.notes)
    if target.suffix == ".json":
        if imported.modes is None:
            raise FileError(f"{target}: only modes go into .json, and {source} holds none; end --out in .h5")
        save_modes(imported.modes, target, imported.facts)
        if not modal:
            notes.append("signals left out; import them with --out ending in .h5")
    else:
        save_imported(imported, target)
        if imported.modes is not None:
            notes.append(f"{len(imported.modes)} modes left out; import them with --out ending in .json")
    if as_json:
        print_json(_document(imported, target, notes))
    elif not quiet:
        for line in (*_held(imported), *(f"note: {note}" for note in notes), f"written: {target}"):
            click.echo(coloured(line))


def _write(path: Path, text: str, force: bool) -> None:
    from lab.errors import FileError

    try:
        with path.open("w" if force else "x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise FileError(f"{path}: exists already; choose another --write-recipe or add --force") from None


def _held(imported: Any) -> list[str]:
    """What was imported, one line each."""
    lines = []
    if imported.recording is not None:
        lines.append(repr(imported.recording))
        sides = (("input ", imported.recording.inputs), ("output", imported.recording.outputs))
        lines += [f"  {side} {each.name} [{each.unit}]" for side, channels in sides for each in channels]
    if imported.response is not None:
        lines.append(repr(imported.response))
    if imported.modes is not None:
        lines.append(repr(imported.modes))
    if imported.geometry is not None:
        lines.append(f"Geometry({len(imported.geometry.nodes)} nodes, {len(imported.geometry.lines)} lines)")
    return lines


def _document(imported: Any, target: Path, notes: list[str]) -> dict[str, Any]:
    recording, response = imported.recording, imported.response
    return {
        "file": str(target),
        "records": 0 if recording is None else len(recording.records),
        "samples": 0 if recording is None else recording.n_samples,
        "sample_rate": None if recording is None else recording.sample_rate,
        **{
            side: {} if recording is None else {each.name: each.unit for each in getattr(recording, side)}
            for side in ("inputs", "outputs")
        },
        "frequency_lines": 0 if response is None else int(response.frequency_hz.size),
        "modes": 0 if imported.modes is None else len(imported.modes),
        "nodes": 0 if imported.geometry is None else len(imported.geometry.nodes),
        "source_sha256": imported.facts["source_sha256"],
        "notes": notes,
    }
