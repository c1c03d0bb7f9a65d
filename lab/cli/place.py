"""`lab place`: where sensors and actuators should go."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from lab.cli.shared import Doing, example, output_options, print_outcome, typed


@click.command(
    "place",
    epilog=example(
        "lab place --model models/truss.xml --sensors 5 --actuators 4 --target matrices --out out/place"
    ),
)
@output_options
@click.option("--seed", type=click.IntRange(min=0), help="Of the random forces of the planned test.")
@click.option(
    "--cause", "causes", multiple=True, help="Cause to tell apart; the whole catalogue if left out."
)
@click.option("--size", type=float, help="Size of the effects, as a share of the outputs [default: 0.01].")
@click.option(
    "--noise", multiple=True, metavar="UNIT=STD", help="Noise of sensors, as m/s^2=0.01; for each unit."
)
@click.option("--noise-percent", type=float, help="Noise in percent of each output's RMS [default: 1].")
@click.option("--duration", type=float, help="Of each record of the planned test [s].")
@click.option("--sample-rate", type=float, help="Of the planned test [Hz].")
@click.option("--level", type=float, help="Amplitude or RMS of the planned forces [N].")
@click.option("--excitation", help="Planned signal, as random, sweep or pulse [default: random].")
@click.option(
    "--scenario", metavar="SCENARIO.toml", help="The test that is planned; its own layout is ranked too."
)
@click.option("--sensor-mass", type=float, help="Of each sensor [kg]: what it does to the frequencies.")
@click.option("--references", type=click.IntRange(min=1), help="Sensors that stay in every set-up.")
@click.option("--setups", type=click.IntRange(min=1), help="Set-ups between which the other sensors rove.")
@click.option("--modes", "n_modes", type=click.IntRange(min=1), help="Lowest modes to tell apart.")
@click.option("--criterion", help="d, a, e or, for modes, mac [default: d for modes, a for matrices].")
@click.option("--triaxial", is_flag=True, help="The axes of a sensor are chosen together.")
@click.option("--quantity", help="Of the sensors: acceleration, velocity or displacement.")
@click.option(
    "--forbid", multiple=True, metavar="NAME", help="Sensor or actuator left out; * and ? are wildcards."
)
@click.option("--fixed", multiple=True, metavar="NAME", help="Sensor or actuator that must be chosen.")
@click.option(
    "--target",
    type=click.Choice(("modes", "matrices", "diagnosis")),
    default="modes",
    show_default=True,
    help="What the test is for.",
)
@click.option("--actuators", "n_actuators", type=click.IntRange(min=0), default=0, help="How many actuators.")
@click.option("--sensors", "n_sensors", type=click.IntRange(min=1), required=True, help="How many sensors.")
@click.option("--model", metavar="MODEL.xml", help="The structure in MJCF, with all candidates in it.")
def command(
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
    """Where sensors and actuators should go, and what each choice costs."""
    from lab.files.placement import placement_document
    from lab.place_files import place_file
    from lab.placement_summary import placement_summary

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
        name = {"n_modes": "modes", "causes": "cause"}.get(foreign[0], foreign[0]).replace("_", "-")
        raise click.UsageError(f"--{name} means nothing for the target {target}.")
    folder = out or Path("out") / f"{Path(model or scenario or 'model').stem}_placement"
    with Doing(quiet) as progress:
        progress("placing")
        placement, _ = place_file(
            model,
            folder,
            n_sensors,
            n_actuators=n_actuators,
            target=target,
            scenario=scenario,
            test=test,
            noise=_noise(noise),
            force=force,
            command=typed(),
            **settings,
        )
    document, text = partial(placement_document, placement), partial(placement_summary, placement)
    print_outcome(document, text, placement.warnings, folder, as_json, quiet)


def _noise(given: tuple[str, ...]) -> dict[str, float] | None:
    """Standard deviations by unit, from texts such as m/s^2=0.01."""
    found = {}
    for text in given:
        unit, _, number = text.partition("=")
        try:
            found[unit] = float(number)
        except ValueError:
            raise click.UsageError(f"--noise is {text!r}; expected UNIT=STD, such as m/s^2=0.01.") from None
        if not found[unit] > 0:
            raise click.UsageError(f"--noise is {text!r}; expected a positive number.")
    return found or None
