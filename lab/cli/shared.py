"""What commands share: options, and the print of an outcome."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click

from lab.cli.colour import coloured
from lab.cli.completion import names_of

Command = Callable[..., None]
FILE = click.Path(path_type=Path)

quiet_option = click.option("--quiet", is_flag=True, help="Say nothing but warnings and errors.")
json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else."
)
force_option = click.option("--force", is_flag=True, help="Replace an earlier output.")
map_option = click.option(
    "--map",
    "mapping",
    metavar="FILE.toml",
    type=FILE,
    help='Renames channels: lines "name in the recording" = "name in the model".',
)


def example(text: str) -> str:
    """The end of a command's help; it keeps its line, so that it can be copied."""
    return f"\b\nExample: {text}"


def out_option(default: str) -> Callable[[Command], Command]:
    """Adds `--out`, a folder, to a command."""
    return click.option("--out", metavar="DIR", type=FILE, help=f"Folder to write into [default: {default}].")


def output_options(default: str) -> Callable[[Command], Command]:
    """Adds `--out`, `--force`, `--json` and `--quiet` to a command."""

    def add(function: Command) -> Command:
        for option in (quiet_option, json_option, force_option, out_option(default)):
            function = option(function)
        return function

    return add


def model_option(text: str, *, required: bool = False) -> Callable[[Command], Command]:
    """Adds `--model` to a command: a file or a name of the catalogue."""
    return click.option(
        "--model",
        metavar="MODEL.xml",
        required=required,
        help=text,
        shell_complete=names_of("models", files=True),
    )


def seed_option(text: str) -> Callable[[Command], Command]:
    """Adds `--seed` to a command."""
    return click.option("--seed", type=click.IntRange(min=0), help=text)


def method_options(function: Command) -> Command:
    """Adds `--method` and `--order` to a command."""
    for option in (
        click.option(
            "--order",
            metavar="N",
            type=click.IntRange(min=1),
            help="Number of states; chosen from the data if left out.",
        ),
        click.option(
            "--method",
            metavar="NAME",
            help="One of `lab list methods`; chosen from the data if left out.",
            shell_complete=names_of("methods"),
        ),
    ):
        function = option(function)
    return function


def named(words: Sequence[str]) -> tuple[str, ...]:
    """Names given one by one or with commas between them."""
    return tuple(name for word in words for each in word.split(",") if (name := each.strip()))


def numbers(
    option: str, words: Sequence[str], form: str, example: str, *, zero: bool = False
) -> dict[str, float]:
    """Positive numbers by name, from texts such as name=0.1.

    Args:
        option: which gave them, for messages.
        words: as typed, one by one or with commas between them.
        form: NAME=NUMBER in the words of the option.
        example: of a word that is right.
        zero: whether a number may be nil.

    Raises:
        UsageError: a word has another form, or its number is not positive and finite.
    """
    found = {}
    for word in named(words):
        name, _, text = (part.strip() for part in word.rpartition("="))
        try:
            number = float(text)
        except ValueError:
            number = float("nan")
        if not name or math.isnan(number):
            raise click.UsageError(f"{option} is {word!r}; expected {form}, such as {example}.")
        if not 0 < number < math.inf and not (zero and number == 0):
            raise click.UsageError(f"{option} is {word!r}; expected a positive number, such as {example}.")
        found[name] = number
    return found


def name_of_recording(recording: Path) -> str:
    """What output of a recording is called by default: after its folder if the lab named the file, else after the file."""
    return recording.resolve().parent.name if recording.name == "recording.h5" else recording.stem


def tell(result: Any, folder: Path, as_json: bool, quiet: bool) -> None:
    """Prints the outcome of an identification."""
    from lab.files.results import result_document
    from lab.summary import summary

    document, text = partial(result_document, result), partial(summary, result)
    print_outcome(document, text, result.warnings, folder, as_json, quiet)


def print_outcome(
    document: Callable[[], Any],
    summary: Callable[[], str],
    warnings: Sequence[str],
    folder: Path,
    as_json: bool,
    quiet: bool,
) -> None:
    """Prints an outcome: as JSON, as a summary, or only its warnings."""
    if as_json:
        print_json(document())
    elif quiet:
        for warning in warnings:
            click.echo(coloured(f"warning: {warning}"), err=True)
    else:
        click.echo(coloured(summary()))
        click.echo(f"\nwritten: {folder}, with report.html; see it move with: lab view {folder}")


def print_json(document: Any) -> None:
    """Prints a document as JSON, and nothing else."""
    click.echo(json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False))


def typed() -> str:
    """The command line as it was typed."""
    return str(click.get_current_context().obj)
