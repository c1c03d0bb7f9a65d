"""What commands share: options, progress on a terminal, the print of an outcome."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click


def example(text: str) -> str:
    """The end of a command's help."""
    return f"Example: {text}"


def output_options(function: Callable[..., None]) -> Callable[..., None]:
    """Adds `--out`, `--force`, `--json` and `--quiet` to a command."""
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


def method_options(function: Callable[..., None]) -> Callable[..., None]:
    """Adds `--method` and `--order` to a command."""
    for option in (
        click.option(
            "--order", type=click.IntRange(min=1), help="Number of states; chosen from the data if left out."
        ),
        click.option("--method", help="One of `lab list methods`; chosen from the data if left out."),
    ):
        function = option(function)
    return function


class Progress:
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
        """Moves the bar on by n of a total."""
        if self.bar is not None:
            self.bar.length = total
            self.bar.update(n)

    def __exit__(self, *error: Any) -> None:
        if self.bar is not None:
            self.bar.__exit__(*error)


class Doing:
    """What is being done, on one line of a terminal, and nothing elsewhere."""

    def __init__(self, quiet: bool) -> None:
        self.shown = sys.stderr.isatty() and not quiet

    def __enter__(self) -> Callable[[str], None]:
        return self.show

    def show(self, what: str) -> None:
        """Tells what is being done."""
        if self.shown:
            # Back to the start of the line, which is cleared.
            click.echo(f"\r\x1b[K{what} …", nl=False, err=True)

    def __exit__(self, *error: Any) -> None:
        if self.shown:
            click.echo("\r\x1b[K", nl=False, err=True)


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
    elif not quiet:
        click.echo(summary())
        click.echo(f"\nwritten: {folder}, with report.html; see it move with: lab view {folder}")
    else:
        for warning in warnings:
            click.echo(f"warning: {warning}", err=True)


def print_json(document: Any) -> None:
    """Prints a document as JSON, and nothing else."""
    click.echo(json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False))


def typed() -> str:
    """The command line as it was typed."""
    return str(click.get_current_context().obj)
