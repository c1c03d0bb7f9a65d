"""`lab identify`: modes and matrices of any recording, or of frequency responses."""

from __future__ import annotations

from pathlib import Path

import click

from lab.cli.progress import Bar
from lab.cli.shared import (
    FILE,
    example,
    map_option,
    method_options,
    model_option,
    name_of_recording,
    output_options,
    tell,
    typed,
)


@click.command(
    "identify",
    short_help="Modes, and M, C, K, of any recording.",
    epilog=example("lab identify out/chain3/recording.h5 --method era --out out/again"),
)
@click.argument("recording", metavar="RECORDING.h5", type=FILE)
@method_options
@click.option(
    "--refine",
    is_flag=True,
    help="Move modes, and M, C, K where the set-up allows, to the maximum of the likelihood, with its error bars; "
    "needs measured forces, or free decays.",
)
@model_option("The structure, in MJCF: which place each channel reads, and what moves in the viewer.")
@map_option
@output_options("out/NAME_modes")
def command(
    recording: Path,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    method: str | None,
    order: int | None,
    refine: bool,
    model: str | None,
    mapping: Path | None,
) -> None:
    """Modes, and M, C, K where the set-up allows, of any recording, real or virtual.

    Of a file that holds frequency responses and no samples, the responses are taken, by pLSCF.
    """
    from lab.run import identify_file

    folder = out or Path("out") / f"{name_of_recording(recording)}_modes"
    with Bar(quiet) as progress:
        progress("reading", 0.0)
        result = identify_file(
            recording,
            folder,
            method=method,
            order=order,
            refine=refine,
            model=model,
            mapping=mapping,
            force=force,
            command=typed(),
            progress=progress,
        )
    tell(result, folder, as_json, quiet)
