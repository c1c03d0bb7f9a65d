"""`lab list`: what there is."""

from __future__ import annotations

import click

from lab.cli.shared import example, json_option, print_json


@click.command(
    "list",
    short_help="Models, scenarios, methods and effects that there are.",
    epilog=example("lab list scenarios"),
)
@click.argument("kinds", type=click.Choice(["models", "scenarios", "methods", "effects"]), nargs=-1)
@json_option
def command(kinds: tuple[str, ...], as_json: bool) -> None:
    """What there is: models, scenarios, methods, effects."""
    from lab import catalogue

    listed = {each: catalogue.listing(each) for each in kinds or catalogue.KINDS}
    if as_json:
        print_json(listed)
        return
    for each, entries in listed.items():
        if len(listed) > 1:
            click.echo(click.style(f"{each}:", bold=True))
        width = max(map(len, entries), default=0)
        for name, text in entries.items():
            click.echo(f"  {name:<{width}}  {_shorten(text, 100 - width)}")
        if not entries:
            click.echo("  none yet")


def _shorten(text: str, width: int) -> str:
    import textwrap

    return textwrap.shorten(text, width, placeholder=" …")
