"""Placement -> placement.json, plain enough for any language to read."""

from __future__ import annotations

from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from lab.files.document import plain, read_document, write_document
from lab.placement.outcome import Placement

FORMAT = "modal-placement"
VERSION = 1
KEYS = ("target", "criterion", "sensors", "actuators", "figure", "proven", "ranking", "warnings")


def placement_document(placement: Placement) -> dict[str, Any]:
    """What `placement.json` says, as plain lists, numbers and texts; None for a number that is not finite."""
    own: dict[str, Any] = {}
    for each in fields(placement):
        value = getattr(placement, each.name)
        if each.name in ("ranking", "drives", "causes"):
            value = [asdict(row) for row in value]
        elif each.name == "figures":
            value = value.tolist()
        own[each.name] = value
    return dict(plain({"format": FORMAT, "version": VERSION, **own}))


def save_placement(placement: Placement, path: str | Path) -> None:
    """Writes `placement.json`; an existing file is replaced once the new one is whole.

    Raises:
        FileError: the file cannot be written.
    """
    write_document(placement_document(placement), path)


def load_placement(path: str | Path) -> dict[str, Any]:
    """The document in a `placement.json`, checked for format, version and main keys.

    Raises:
        FileError: no such file, not JSON, of another format or version, or incomplete.
    """
    return read_document(path, form=FORMAT, version=VERSION, keys=KEYS)
