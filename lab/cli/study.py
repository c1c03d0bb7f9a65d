"""`lab study`: many runs of a scenario."""

from __future__ import annotations

from pathlib import Path

import click

from lab.cli.shared import Progress, example, output_options, print_json, typed


@click.command("study", epilog=example("lab study scenarios/studies/noise.toml --out out/noise"))
@click.argument("study_file", metavar="STUDY.toml", type=click.Path(path_type=Path))
@output_options
@click.option(
    "--scheduler", metavar="ADDRESS", help="Scheduler of a Dask cluster, which does the work instead."
)
@click.option(
    "--workers", type=click.IntRange(min=1), help="Processes on this machine [default: one per core]."
)
def command(
    study_file: Path,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    workers: int | None,
    scheduler: str | None,
) -> None:
    """Many runs of a scenario with something varied: sweeps, Monte Carlo.

    Stopped, however rudely, the same command goes on where it stopped; a study file that asks for more values or
    repeats adds runs to those that are there.
    """
    from lab.studies.conduct import study
    from lab.studies.outcome import study_document
    from lab.studies.wording import study_summary

    folder = out or Path("out") / study_file.stem
    with Progress("running", quiet) as progress:
        outcome = study(
            study_file,
            folder,
            workers=workers,
            scheduler=scheduler,
            force=force,
            command=typed(),
            progress=progress,
        )
    if as_json:
        print_json(study_document(outcome))
    elif not quiet:
        click.echo(study_summary(outcome))
        click.echo(f"\nwritten: {folder}, with study.h5 and report.html")
    else:
        for warning in outcome.warnings:
            click.echo(f"warning: {warning}", err=True)
