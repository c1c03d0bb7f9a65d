"""`lab diagnose`: what a model gets wrong in a recording."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path

import click

from lab.cli.completion import names_of
from lab.cli.progress import Bar
from lab.cli.shared import (
    FILE,
    example,
    map_option,
    model_option,
    name_of_recording,
    named,
    numbers,
    output_options,
    print_outcome,
    typed,
)

LONG = 2**16
"""Size of a recording [bytes] that takes longer than processes to get ready to help."""


@click.command(
    "diagnose",
    short_help="What a model gets wrong in a recording, and why.",
    epilog=example("lab diagnose my_test.h5 --model my_structure.xml --out out/my_test"),
)
@click.argument("recording", metavar="RECORDING.h5", type=FILE)
@model_option("What the structure is believed to be, in MJCF.", required=True)
@click.option(
    "--baseline",
    metavar="RECORDING.h5",
    type=FILE,
    help="Recording of the same structure in its known state, to calibrate the model first.",
)
@map_option
@click.option(
    "--widths",
    multiple=True,
    metavar="NAME=SHARE,…",
    help="How far the model's own numbers may be off, relative, one standard deviation: of a group, as damping=0.5, or of "
    "one parameter, as 'stiffness spring2_3=0.1' or 'gain motor=0.14' [default: mass=0.005,stiffness=0.02,damping=0.25; "
    "gains of inputs are known].",
)
@click.option(
    "--effects",
    multiple=True,
    metavar="NAME,…",
    help="Causes that may be named, of `lab list effects`; all of them if left out.",
    shell_complete=names_of("effects"),
)
@output_options("out/NAME_diagnosis")
def command(
    recording: Path,
    model: str,
    baseline: Path | None,
    mapping: Path | None,
    widths: tuple[str, ...],
    effects: tuple[str, ...],
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """What a model gets wrong in a recording, why, the extended model, and the gain.

    MODEL.xml is a file, or a name from `lab list models`.
    """
    folder = out or Path("out") / f"{name_of_recording(recording)}_diagnosis"
    with Bar(quiet) as progress, _helped(recording):
        # Others load what they need while this process does.
        from lab.diagnose_files import diagnose_file
        from lab.diagnosis_summary import diagnosis_summary
        from lab.files.diagnosis import diagnosis_document

        progress("reading", 0.0)
        diagnosis, known = diagnose_file(
            recording,
            model,
            folder,
            baseline=baseline,
            mapping=mapping,
            widths=numbers("--widths", widths, "NAME=SHARE", "damping=0.5", zero=True),
            effects=named(effects) or None,
            force=force,
            command=typed(),
            progress=progress,
        )
    document, text = partial(diagnosis_document, diagnosis), partial(diagnosis_summary, diagnosis, known)
    print_outcome(document, text, diagnosis.warnings, folder, as_json, quiet)


def _helped(recording: Path) -> AbstractContextManager[None]:
    """Processes that help with the search and draw the report, where they pay."""
    if not recording.is_file() or recording.stat().st_size < LONG:
        return nullcontext()
    from lab.hands import helped

    return helped("lab.diagnosis.diagnose", "lab.kernel", "lab.show.diagnosis_report")
