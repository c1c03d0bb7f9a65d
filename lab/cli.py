"""The `lab` command: thin, and quick to answer because everything heavy is imported inside the commands."""

from __future__ import annotations

import json
import os
import shlex
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import click

EXAMPLES = {
    "list": "lab list scenarios",
    "run": "lab run scenarios/chain3_pulse.toml --out out/chain3",
    "identify": "lab identify out/chain3/recording.h5 --method era --out out/again",
    "diagnose": "lab diagnose my_test.h5 --model my_structure.xml --out out/my_test",
    "view": "lab view out/chain3",
}


def _command(name: str) -> Callable[[Callable[..., None]], click.Command]:
    return cli.command(name, epilog=f"Example: {EXAMPLES[name]}")


def _output_options(function: Callable[..., None]) -> Callable[..., None]:
    for option in (
        click.option("--quiet", is_flag=True, help="Say nothing but warnings and errors."),
        click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else."),
        click.option("--force", is_flag=True, help="Replace an earlier output in the folder."),
        click.option(
            "--out", type=click.Path(path_type=Path), help="Folder to write into [default: out/NAME]."
        ),
    ):
        function = option(function)
    return function


def _method_options(function: Callable[..., None]) -> Callable[..., None]:
    for option in (
        click.option(
            "--order", type=click.IntRange(min=1), help="Number of states; chosen from the data if left out."
        ),
        click.option("--method", help="One of `lab list methods`; chosen from the data if left out."),
    ):
        function = option(function)
    return function


@click.group(
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog=f"Example: {EXAMPLES['run']}",
)
@click.version_option(package_name="virtual-modal-lab", prog_name="lab")
@click.pass_context
def cli(context: click.Context) -> None:
    """The virtual modal lab: simulate, measure, identify, compare, diagnose."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@_command("list")
@click.argument("kinds", type=click.Choice(["models", "scenarios", "methods", "effects"]), nargs=-1)
@click.option("--json", "as_json", is_flag=True, help="Print the lists as JSON.")
def list_command(kinds: tuple[str, ...], as_json: bool) -> None:
    """What there is: models, scenarios, methods, effects."""
    from lab import catalogue

    listed = {each: catalogue.listing(each) for each in kinds or catalogue.KINDS}
    if as_json:
        _print_json(listed)
        return
    for each, entries in listed.items():
        if len(listed) > 1:
            click.echo(f"{each}:")
        width = max(map(len, entries), default=0)
        for name, text in entries.items():
            click.echo(f"  {name:<{width}}  {_shorten(text, 100 - width)}")
        if not entries:
            click.echo("  none yet")


@_command("run")
@click.argument("scenario", metavar="SCENARIO.toml")
@_output_options
@click.option(
    "--seed", type=click.IntRange(min=0), help="Seed of everything random, instead of the scenario's."
)
@_method_options
def run_command(
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
    with _Progress("simulating", quiet) as progress:
        result = run(test, folder, force=force, command=_typed(), progress=progress)
    _tell(result, folder, as_json, quiet)


@_command("identify")
@click.argument("recording", metavar="RECORDING.h5", type=click.Path(path_type=Path))
@_output_options
@_method_options
def identify_command(
    recording: Path,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    method: str | None,
    order: int | None,
) -> None:
    """Modes, and M, C, K where the set-up allows, of any recording, real or virtual."""
    from lab.run import identify_file

    folder = out or Path("out") / f"{recording.resolve().parent.name}_{recording.stem}"
    result = identify_file(recording, folder, method=method, order=order, force=force, command=_typed())
    _tell(result, folder, as_json, quiet)


@_command("diagnose")
@click.argument("recording", metavar="RECORDING.h5", type=click.Path(path_type=Path))
@_output_options
@click.option(
    "--map",
    "mapping",
    metavar="FILE.toml",
    type=click.Path(path_type=Path),
    help='Renames channels: lines "name in the recording" = "name in the model".',
)
@click.option(
    "--baseline",
    metavar="RECORDING.h5",
    type=click.Path(path_type=Path),
    help="Recording of the same structure in its known state, to calibrate the model first.",
)
@click.option(
    "--model", metavar="MODEL.xml", required=True, help="What the structure is believed to be, in MJCF."
)
def diagnose_command(
    recording: Path,
    model: str,
    baseline: Path | None,
    mapping: Path | None,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """What a model gets wrong in a recording, why, the extended model, and the gain."""
    from lab.diagnose_files import diagnose_file
    from lab.diagnosis_summary import diagnosis_summary
    from lab.files.diagnosis import diagnosis_document

    folder = out or Path("out") / f"{recording.resolve().parent.name}_{recording.stem}_diagnosis"
    with _Doing(quiet) as progress:
        diagnosis, known = diagnose_file(
            recording,
            model,
            folder,
            baseline=baseline,
            mapping=mapping,
            force=force,
            command=_typed(),
            progress=progress,
        )
    document, text = partial(diagnosis_document, diagnosis), partial(diagnosis_summary, diagnosis, known)
    _print_outcome(document, text, diagnosis.warnings, folder, as_json, quiet)


@_command("view")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def view_command(folder: Path) -> None:
    """Open the run.rrd of an output folder in the Rerun viewer."""
    from lab.view import view

    view(folder)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run one command and exit: 0 done, 1 a fault of the lab's own, 2 the input is at fault."""
    signal.signal(signal.SIGTERM, _stop)
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
    click.echo(f"lab: {' '.join(message.split())}", err=True)
    sys.exit(status)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    # Ending as an exception lets every half-written output be removed.
    sys.exit(128 + number)


class _Progress:
    """A bar on a terminal, nothing elsewhere."""

    def __init__(self, label: str, quiet: bool) -> None:
        self.bar: Any = None
        if sys.stderr.isatty() and not quiet:
            self.bar = click.progressbar(length=1, label=label, file=sys.stderr)

    def __enter__(self) -> Callable[..., None]:
        if self.bar is not None:
            self.bar.__enter__()
        return self.show

    def show(self, n: int, *, total: int) -> None:
        if self.bar is not None:
            self.bar.length = total
            self.bar.update(n)

    def __exit__(self, *error: Any) -> None:
        if self.bar is not None:
            self.bar.__exit__(*error)


class _Doing:
    """What is being done, on one line of a terminal, and nothing elsewhere."""

    def __init__(self, quiet: bool) -> None:
        self.shown = sys.stderr.isatty() and not quiet

    def __enter__(self) -> Callable[[str], None]:
        return self.show

    def show(self, what: str) -> None:
        if self.shown:
            # Back to the start of the line, which is cleared.
            click.echo(f"\r\x1b[K{what} …", nl=False, err=True)

    def __exit__(self, *error: Any) -> None:
        if self.shown:
            click.echo("\r\x1b[K", nl=False, err=True)


def _tell(result: Any, folder: Path, as_json: bool, quiet: bool) -> None:
    from lab.files.results import result_document
    from lab.summary import summary

    document, text = partial(result_document, result), partial(summary, result)
    _print_outcome(document, text, result.warnings, folder, as_json, quiet)


def _print_outcome(
    document: Callable[[], Any],
    summary: Callable[[], str],
    warnings: Sequence[str],
    folder: Path,
    as_json: bool,
    quiet: bool,
) -> None:
    if as_json:
        _print_json(document())
    elif not quiet:
        click.echo(summary())
        click.echo(f"\nwritten: {folder}, with report.html; see it move with: lab view {folder}")
    else:
        for warning in warnings:
            click.echo(f"warning: {warning}", err=True)


def _print_json(document: Any) -> None:
    click.echo(json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False))


def _typed() -> str:
    return str(click.get_current_context().obj)


def _shorten(text: str, width: int) -> str:
    import textwrap

    return textwrap.shorten(text, width, placeholder=" …")
