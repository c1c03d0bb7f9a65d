"""The `lab` command: thin, and quick to answer because everything heavy is imported inside the commands."""

from __future__ import annotations

import atexit
import gc
import os
import shlex
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

import click

from lab.cli.check import command as check
from lab.cli.colour import coloured, wanted
from lab.cli.diagnose import command as diagnose
from lab.cli.export import command as export
from lab.cli.identify import command as identify
from lab.cli.import_ import command as import_
from lab.cli.listing import command as listing
from lab.cli.place import command as place
from lab.cli.run import command as run
from lab.cli.shared import example
from lab.cli.study import command as study
from lab.cli.view import command as view

COMMANDS = (run, view, import_, check, identify, diagnose, place, study, export, listing)
"""One file each."""


class Ordered(click.Group):
    """Commands in the order of a test, not of the alphabet."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names as they were added."""
        return list(self.commands)


@click.group(
    cls=Ordered,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog=example("lab run scenarios/chain3_pulse.toml --out out/chain3"),
)
@click.version_option(package_name="virtual-modal-lab", prog_name="lab")
@click.pass_context
def cli(context: click.Context) -> None:
    """The virtual modal lab: simulate, measure, identify, compare, diagnose."""
    context.color = wanted()
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for each in COMMANDS:
    cli.add_command(each)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run one command and exit: 0 done, 1 a fault of the lab's own, 2 the input is at fault."""
    signal.signal(signal.SIGTERM, _stop)
    # Looking for cycles in all that was loaded takes half a second at the end, where the memory is given back anyway, and a
    # twentieth of the time before.
    atexit.register(gc.freeze)
    gc.set_threshold(100_000, 50, 100)
    # Matrices here are small: threads cost more than they bring, and sums must not depend on the number of cores.
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    typed = list(sys.argv[1:] if arguments is None else arguments)
    try:
        cli.main(typed, prog_name="lab", standalone_mode=False, obj=shlex.join(["lab", *typed]))
        sys.stdout.flush()
    except click.Abort:
        _fail("stopped", 130)
    except click.ClickException as error:
        where = error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else "lab"
        _fail(f"{error.format_message()} See '{where} --help'.")
    except BrokenPipeError:
        # The reader of our output has left; nobody is there to be told, nor at the last flush.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        if error.strerror is None:
            raise
        _fail(f"{error.filename or 'input or output'}: {error.strerror}")
    except Exception as error:
        from identification.errors import IdentificationError
        from lab.errors import LabError

        if not isinstance(error, LabError | IdentificationError):
            raise
        _fail(str(error))
    sys.exit(0)


def _fail(message: str, status: int = 2) -> NoReturn:
    click.echo(coloured(f"lab: {' '.join(message.split())}"), err=True, color=wanted())
    sys.exit(status)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    # Ending as an exception lets every half-written output be removed.
    sys.exit(128 + number)
