"""`lab study`: many runs of a scenario."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import click

from lab.cli.colour import coloured
from lab.cli.progress import Bar
from lab.cli.shared import FILE, example, output_options, print_json, seed_option, typed


def _counted(bar: Bar) -> Callable[..., None]:
    """Moves a bar on by runs finished; behind the last, their outcomes are collected."""
    finished = 0

    def count(n: int, *, total: int) -> None:
        nonlocal finished
        finished += n
        bar("running" if finished < total else "collecting", finished / total)

    return count


@click.command(
    "study",
    short_help="Many runs of a scenario: sweeps, Monte Carlo.",
    epilog=example("lab study scenarios/studies/noise.toml --out out/noise"),
)
@click.argument("study_file", metavar="STUDY.toml", type=FILE)
@click.option(
    "--workers",
    metavar="N",
    type=click.IntRange(min=1),
    help="Processes on this machine [default: one per core].",
)
@click.option(
    "--scheduler", metavar="ADDRESS", help="Scheduler of a Dask cluster, which does the work instead."
)
@seed_option("Seed of all runs, instead of the study's.")
@output_options("out/STUDY")
def command(
    study_file: Path,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    workers: int | None,
    scheduler: str | None,
    seed: int | None,
) -> None:
    """Many runs of a scenario with something varied: sweeps, Monte Carlo.

    Stopped, however rudely, the same command goes on where it stopped; a study file that asks for more values or
    repeats adds runs to those that are there.
    """
    from lab.studies.conduct import study
    from lab.studies.outcome import study_document
    from lab.studies.plan import load_study
    from lab.studies.wording import study_summary

    asked = load_study(study_file)
    if seed is not None:
        if any("seed" in axis.setting(0) for axis in asked.axes):
            raise click.UsageError(f"--seed means nothing here: {study_file} varies 'seed' itself.")
        asked = replace(asked, seed=seed)
    folder = out or Path("out") / study_file.stem
    with Bar(quiet) as bar:
        bar("running", 0.0)
        outcome = study(
            asked,
            folder,
            workers=workers,
            scheduler=scheduler,
            force=force,
            command=typed(),
            progress=_counted(bar),
        )
    if as_json:
        print_json(study_document(outcome))
    elif not quiet:
        click.echo(coloured(study_summary(outcome)))
        click.echo(f"\nwritten: {folder}, with study.h5 and report.html")
    else:
        for warning in outcome.warnings:
            click.echo(coloured(f"warning: {warning}"), err=True)
