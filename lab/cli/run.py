"""`lab run`: a whole virtual test."""

from __future__ import annotations

from pathlib import Path

import click

from lab.cli.shared import Progress, example, method_options, output_options, tell, typed


@click.command("run", epilog=example("lab run scenarios/chain3_pulse.toml --out out/chain3"))
@click.argument("scenario", metavar="SCENARIO.toml")
@output_options
@click.option(
    "--seed", type=click.IntRange(min=0), help="Seed of everything random, instead of the scenario's."
)
@method_options
def command(
    scenario: str,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    seed: int | None,
    method: str | None,
    order: int | None,
) -> None:
    """A whole virtual test: simulate, measure, identify, compare with the truth, report.

    SCENARIO.toml is a file, or a name from `lab list scenarios`.
    """
    from lab.run import run
    from lab.scenario import load_scenario

    test = load_scenario(scenario).changed(seed=seed, method=method, order=order)
    folder = out or Path("out") / Path(scenario).stem
    with Progress("simulating", quiet) as progress:
        result = run(test, folder, force=force, command=typed(), progress=progress)
    tell(result, folder, as_json, quiet)
