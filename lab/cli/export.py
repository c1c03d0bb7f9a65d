"""`lab export`: recordings and results for other programs."""

from __future__ import annotations

from pathlib import Path

import click

from lab.cli.colour import coloured
from lab.cli.shared import FILE, example, force_option, json_option, model_option, print_json, quiet_option


@click.command(
    "export",
    short_help="Modes, signals or matrices for other programs.",
    epilog=example("lab export out/chain3 --to modes.uff --model models/chain3_uncoupled.xml"),
)
@click.argument("source", metavar="FOLDER_OR_FILE", type=FILE)
@click.option(
    "--to",
    "--out",
    "to",
    required=True,
    metavar="FILE",
    type=FILE,
    help="File to write: .uff, .unv, .mat, .csv, or M.mtx, C.mtx, K.mtx.",
)
@click.option(
    "--what",
    type=click.Choice(["modes", "data", "matrices"]),
    help="What to export, where the source holds several; modes.uff and data.uff say it by their names.",
)
@click.option(
    "--recording",
    metavar="RECORDING.h5",
    type=FILE,
    help="Recording that a result comes from, which knows the units of its shapes.",
)
@model_option("Where the channels are, told by the sensors of a model.")
@click.option(
    "--points",
    metavar="FILE.toml",
    type=FILE,
    help="Node, direction and position of every channel, for universal files.",
)
@click.option("--text", is_flag=True, help="Signals in universal files as text, instead of binary numbers.")
@force_option
@json_option
@quiet_option
def command(
    source: Path,
    to: Path,
    what: str | None,
    recording: Path | None,
    model: str | None,
    points: Path | None,
    text: bool,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Modes, signals or matrices as universal file (UFF), MATLAB, Matrix Market or CSV."""
    from lab.errors import FileError
    from lab.files.exporting import export_file

    if to.exists() and not force:
        raise FileError(f"{to}: exists already; choose another --to or add --force to replace it")
    done = export_file(source, to, what=what, recording=recording, model=model, points=points, text=text)
    if as_json:
        print_json({"file": str(done.path), "what": done.what, "notes": list(done.notes)})
    elif not quiet:
        for line in (*(f"note: {note}" for note in done.notes), f"written: {done.path}"):
            click.echo(coloured(line))
