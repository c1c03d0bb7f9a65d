"""Colours of the words that a reader looks for first; `click.echo` leaves them out where no terminal reads."""

from __future__ import annotations

import os
from typing import Any

import click

STYLES: dict[str, dict[str, Any]] = {
    "warning:": {"fg": "yellow", "bold": True},
    "note:": {"fg": "cyan"},
    "lab:": {"fg": "red", "bold": True},
    "Consistent:": {"fg": "green", "bold": True},
    "Explained:": {"fg": "cyan", "bold": True},
    "Unexplained:": {"fg": "yellow", "bold": True},
    "  met ": {"fg": "green"},
    "  MISSED ": {"fg": "red", "bold": True},
    "  fail ": {"fg": "red", "bold": True},
    "  undecided ": {"fg": "yellow"},
    "fault ": {"fg": "red", "bold": True},
    "doubt ": {"fg": "yellow"},
}
"""Beginnings of lines, and how they look."""


def coloured(text: str) -> str:
    """The text with the telling beginnings of its lines in colour."""
    return "\n".join(map(_coloured, text.split("\n")))


def _coloured(line: str) -> str:
    for beginning, style in STYLES.items():
        if line.startswith(beginning):
            return click.style(beginning, **style) + line.removeprefix(beginning)
    return line


def wanted() -> bool | None:
    """False where the user wants no colours (NO_COLOR is set), else None: on a terminal only."""
    return False if os.environ.get("NO_COLOR") else None
