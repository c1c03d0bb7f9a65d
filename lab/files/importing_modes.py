"""Modes that come from elsewhere, as a result document of the lab and back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from identification.modes import Modes
from identification.recording import QUANTITIES, Channel
from lab.errors import FileError
from lab.files.document import plain, write_document
from lab.files.results import FORMAT, VERSION


def save_modes(modes: Modes, path: str | Path, facts: Mapping[str, str | float]) -> None:
    """Writes modes in the form of `result.json`, with the units of the shapes.

    Raises:
        FileError: the file cannot be written.
    """
    write_document(modes_document(modes, facts), path)


def modes_document(modes: Modes, facts: Mapping[str, str | float]) -> dict[str, Any]:
    """Modes in the form of `result.json`, as plain lists, numbers and texts."""
    listed = [
        {
            "frequency_hz": modes.frequency_hz[k],
            "frequency_std": None,
            "damping_ratio": modes.damping_ratio[k],
            "damping_std": None,
            "shape": {
                channel.name: [value.real, value.imag]
                for channel, value in zip(modes.outputs, modes.shapes[:, k], strict=True)
            },
            "stable": True,
        }
        for k in range(len(modes))
    ]
    document = {
        "format": FORMAT,
        "version": VERSION,
        "title": facts.get("source_file", ""),
        "method": "imported",
        "order": 2 * len(modes),
        "sample_rate": None,
        "modes": listed,
        "units": {channel.name: channel.unit for channel in modes.outputs},
        "second_order": None,
        "truth": None,
        "comparison": None,
        "warnings": [],
        "attributes": dict(facts),
    }
    return dict(plain(document))


def modes_in(document: Mapping[str, Any], units: Mapping[str, str]) -> Modes:
    """The modes of a result document.

    Args:
        document: as in `result.json`.
        units: SI unit of every channel, by name; those that the document states itself come first.

    Raises:
        FileError: no modes, a channel without unit, or a damaged document.
    """
    units = {**units, **document.get("units", {})}
    try:
        listed = document["modes"]
        if not listed:
            raise FileError("the result holds no mode; nothing to export")
        names = list(listed[0]["shape"])
        unknown = [name for name in names if units.get(name) not in QUANTITIES]
        if unknown:
            raise FileError(
                f"nothing says in which unit {unknown[0]!r} measures; name the recording with --recording"
            )
        shapes = np.array([[complex(*mode["shape"][name]) for mode in listed] for name in names])
        return Modes(
            np.array([mode["frequency_hz"] for mode in listed], dtype=float),
            np.array([mode["damping_ratio"] for mode in listed], dtype=float),
            shapes,
            tuple(Channel(name, units[name]) for name in names),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise FileError(f"the result is damaged ({type(error).__name__}: {error})") from None
