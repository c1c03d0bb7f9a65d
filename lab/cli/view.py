"""`lab view`: an output folder in the viewer."""

from __future__ import annotations

from pathlib import Path

import click

from lab.cli.shared import FILE, example


@click.command(
    "view",
    short_help="An output folder in the Rerun viewer.",
    epilog=example("lab view out/chain3"),
)
@click.argument("folder", metavar="DIR", type=FILE)
def command(folder: Path) -> None:
    """Open the run.rrd of an output folder, or an .rrd file, in the Rerun viewer.

    Where there is no display, it says what to do instead.
    """
    from lab.view import view

    view(folder)
