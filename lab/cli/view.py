"""`lab view`: an output folder in the viewer."""

from __future__ import annotations

from pathlib import Path

import click

from lab.cli.shared import example


@click.command("view", epilog=example("lab view out/chain3"))
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def command(folder: Path) -> None:
    """Open the run.rrd of an output folder in the Rerun viewer."""
    from lab.view import view

    view(folder)
