"""`lab check`: what is wrong with a recording before any analysis."""

from __future__ import annotations

from pathlib import Path

import click

from lab.cli.colour import coloured
from lab.cli.progress import Bar
from lab.cli.shared import FILE, example, json_option, map_option, model_option, print_json


@click.command(
    "check",
    short_help="What is wrong with a recording before any analysis.",
    epilog=example("lab check my_test.h5 --model my_structure.xml"),
)
@click.argument("recording", metavar="RECORDING.h5", type=FILE)
@model_option("The structure in MJCF, to find channels out of place.")
@map_option
@json_option
@click.option("--quiet", is_flag=True, help="Print faults alone.")
def command(recording: Path, model: str | None, mapping: Path | None, as_json: bool, quiet: bool) -> None:
    """What to know about a recording before any analysis: dead, clipped, swapped channels and the like."""
    from lab.checks import check
    from lab.checks.screen import document, screen
    from lab.files.model import load_model
    from lab.files.recording import load
    from lab.matching import read_mapping, renamed

    with Bar(quiet) as progress:
        progress("reading", 0.0)
        data = load(recording)
        if mapping is not None:
            data = renamed(data, read_mapping(mapping))
        rig = None if model is None else load_model(model)
        remarks = check(data, rig, progress=progress)
    if as_json:
        print_json(document(data, remarks, model))
    else:
        text = screen(data, remarks, model, faults_alone=quiet)
        if text:
            click.echo(coloured(text))
