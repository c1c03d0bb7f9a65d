"""What the shell offers at the tab key: names from the catalogue, and files where none fits."""

from __future__ import annotations

from collections.abc import Callable

import click
from click.shell_completion import CompletionItem

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def names_of(kind: str, *, files: bool = False) -> Complete:
    """Completion by the names of a kind of the catalogue.

    Args:
        kind: models, scenarios, methods or effects.
        files: whether a file will do as well.
    """

    def complete(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
        from lab import catalogue

        before, comma, last = ("", "", begun) if files else begun.rpartition(",")
        found = [
            CompletionItem(f"{before}{comma}{name}", help=text)
            for name, text in catalogue.listing(kind).items()
            if name.startswith(last)
        ]
        return found or ([CompletionItem(begun, type="file")] if files else [])

    return complete
