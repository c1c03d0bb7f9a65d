"""`lab run`: a whole virtual test."""

from __future__ import annotations

from pathlib import Path

import click

from lab.cli.completion import names_of
from lab.cli.progress import Bar
from lab.cli.shared import example, method_options, output_options, seed_option, tell, typed


@click.command(
    "run",
    short_help="A whole virtual test, from the structure to the report.",
    epilog=example("lab run scenarios/chain3_pulse.toml --out out/chain3"),
)
@click.argument("scenario", metavar="SCENARIO.toml", shell_complete=names_of("scenarios", files=True))
@seed_option("Seed of everything random, instead of the scenario's.")
@method_options
@output_options("out/SCENARIO")
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
    with Bar(quiet) as progress:
        progress("simulating", 0.0)
        result = run(test, folder, force=force, command=typed(), progress=progress)
    tell(result, folder, as_json, quiet)
