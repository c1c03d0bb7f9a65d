"""`lab place`: where sensors and actuators should go."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from lab.cli.completion import names_of
from lab.cli.progress import Bar
from lab.cli.shared import (
    FILE,
    example,
    model_option,
    named,
    numbers,
    output_options,
    print_outcome,
    seed_option,
    typed,
)


def _asked(context: click.Context, _: click.Parameter, path: Path | None) -> Path | None:
    """Takes from a placement file what the command line leaves open."""
    if path is not None:
        from lab.placement.file import load_placement_file

        context.default_map = load_placement_file(path)
    return path


@click.command(
    "place",
    short_help="Where sensors and actuators should go.",
    epilog=example("lab place --model models/truss.xml --sensors 5 --actuators 4 --target matrices"),
)
@click.argument(
    "placement_file", metavar="[PLACEMENT.toml]", required=False, type=FILE, is_eager=True, callback=_asked
)
@model_option("The structure in MJCF, with all candidates in it.")
@click.option(
    "--sensors",
    "n_sensors",
    metavar="N",
    type=click.IntRange(min=1),
    required=True,
    help="How many sensors.",
)
@click.option(
    "--actuators",
    "n_actuators",
    metavar="N",
    type=click.IntRange(min=0),
    default=0,
    help="How many actuators.",
)
@click.option(
    "--target",
    type=click.Choice(("modes", "matrices", "diagnosis")),
    default="modes",
    show_default=True,
    help="What the test is for.",
)
@click.option("--fixed", multiple=True, metavar="NAME", help="Sensor or actuator that must be chosen.")
@click.option(
    "--forbid", multiple=True, metavar="NAME", help="Sensor or actuator left out; * and ? are wildcards."
)
@click.option("--quantity", metavar="NAME", help="Of the sensors: acceleration, velocity or displacement.")
@click.option("--triaxial", is_flag=True, help="The axes of a sensor are chosen together.")
@click.option(
    "--criterion", metavar="NAME", help="d, a, e or, for modes, mac [default: d for modes, a for matrices]."
)
@click.option(
    "--modes", "n_modes", metavar="N", type=click.IntRange(min=1), help="Lowest modes to tell apart."
)
@click.option(
    "--setups",
    metavar="N",
    type=click.IntRange(min=1),
    help="Set-ups between which the other sensors rove.",
)
@click.option(
    "--references", metavar="N", type=click.IntRange(min=1), help="Sensors that stay in every set-up."
)
@click.option(
    "--sensor-mass",
    metavar="KG",
    type=float,
    help="Of each sensor [kg]: what it does to the frequencies.",
)
@click.option(
    "--scenario",
    metavar="SCENARIO.toml",
    help="The test that is planned; its own layout is ranked too.",
    shell_complete=names_of("scenarios", files=True),
)
@click.option(
    "--excitation", metavar="KIND", help="Planned signal, as random, sweep or pulse [default: random]."
)
@click.option("--level", metavar="FORCE", type=float, help="Amplitude or RMS of the planned forces [N].")
@click.option("--sample-rate", metavar="HZ", type=float, help="Of the planned test [Hz].")
@click.option("--duration", metavar="S", type=float, help="Of each record of the planned test [s].")
@click.option(
    "--noise-percent", metavar="P", type=float, help="Noise in percent of each output's RMS [default: 1]."
)
@click.option(
    "--noise", multiple=True, metavar="UNIT=STD", help="Noise of sensors, as m/s^2=0.01; for each unit."
)
@click.option(
    "--size",
    metavar="SHARE",
    type=float,
    help="Size of the effects, as a share of the outputs [default: 0.01].",
)
@click.option(
    "--effects",
    "--cause",
    "causes",
    multiple=True,
    metavar="NAME,…",
    help="Causes to tell apart, of `lab list effects`; all of them if left out.",
    shell_complete=names_of("effects"),
)
@seed_option("Seed of the random forces of the planned test.")
@output_options("out/MODEL_placement")
def command(
    placement_file: Path | None,
    model: str | None,
    n_sensors: int,
    n_actuators: int,
    target: str,
    scenario: str | None,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    noise: tuple[str, ...],
    **options: Any,
) -> None:
    """Where sensors and actuators should go, and what each choice costs.

    A placement file may ask all that the options can; options given beside it win.
    """
    from lab.files.placement import placement_document
    from lab.place_files import place_file
    from lab.placement_summary import placement_summary

    options["causes"] = named(options["causes"])
    test = {
        name: options.pop(name)
        for name in ("excitation", "level", "sample_rate", "duration", "noise_percent", "seed")
    }
    own = {
        "modes": ("criterion", "n_modes", "setups", "references", "sensor_mass"),
        "matrices": ("criterion",),
        "diagnosis": ("size", "causes"),
    }[target]
    settings = {
        name: value
        for name, value in options.items()
        if value not in (None, (), False)
        and (name in own or name in ("fixed", "forbid", "quantity", "triaxial"))
    }
    foreign = [
        name for name, value in options.items() if value not in (None, (), False) and name not in settings
    ]
    if foreign:
        name = {"n_modes": "modes", "causes": "effects"}.get(foreign[0], foreign[0]).replace("_", "-")
        raise click.UsageError(f"--{name} means nothing for the target {target}.")
    asked = placement_file or Path(model or scenario or "model")
    folder = out or Path("out") / f"{asked.stem}_placement"
    with Bar(quiet) as progress:
        progress("placing", 0.0)
        placement, _ = place_file(
            model,
            folder,
            n_sensors,
            n_actuators=n_actuators,
            target=target,
            scenario=scenario,
            test=test,
            noise=numbers("--noise", noise, "UNIT=STD", "m/s^2=0.01") or None,
            force=force,
            command=typed(),
            progress=progress,
            **settings,
        )
    document, text = partial(placement_document, placement), partial(placement_summary, placement)
    print_outcome(document, text, placement.warnings, folder, as_json, quiet)
