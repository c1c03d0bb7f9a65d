"""`lab diagnose`: what a model gets wrong in a recording."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from lab.cli.shared import Doing, example, output_options, print_outcome, typed


@click.command(
    "diagnose", epilog=example("lab diagnose my_test.h5 --model my_structure.xml --out out/my_test")
)
@click.argument("recording", metavar="RECORDING.h5", type=click.Path(path_type=Path))
@output_options
@click.option(
    "--map",
    "mapping",
    metavar="FILE.toml",
    type=click.Path(path_type=Path),
    help='Renames channels: lines "name in the recording" = "name in the model".',
)
@click.option(
    "--baseline",
    metavar="RECORDING.h5",
    type=click.Path(path_type=Path),
    help="Recording of the same structure in its known state, to calibrate the model first.",
)
@click.option(
    "--model", metavar="MODEL.xml", required=True, help="What the structure is believed to be, in MJCF."
)
def command(
    recording: Path,
    model: str,
    baseline: Path | None,
    mapping: Path | None,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """What a model gets wrong in a recording, why, the extended model, and the gain."""
    from lab.diagnose_files import diagnose_file
    from lab.diagnosis_summary import diagnosis_summary
    from lab.files.diagnosis import diagnosis_document

    folder = out or Path("out") / f"{recording.resolve().parent.name}_{recording.stem}_diagnosis"
    with Doing(quiet) as progress:
        diagnosis, known = diagnose_file(
            recording,
            model,
            folder,
            baseline=baseline,
            mapping=mapping,
            force=force,
            command=typed(),
            progress=progress,
        )
    document, text = partial(diagnosis_document, diagnosis), partial(diagnosis_summary, diagnosis, known)
    print_outcome(document, text, diagnosis.warnings, folder, as_json, quiet)
