"""What an export starts from, and what lies in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from identification.modes import Modes
from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.errors import FileError
from lab.files.document import read_document
from lab.files.importing_modes import modes_in
from lab.files.recording import load
from lab.files.recording_responses import has_responses, load_responses
from lab.files.results import FORMAT, VERSION


@dataclass(frozen=True)
class Given:
    """What an export starts from: a recording file, a result, or both.

    Attributes:
        recording: or None.
        result: or None.
        model: MJCF file that tells where sensors are, or None.
        points: TOML file that tells it, or None.
    """

    recording: Path | None
    result: Path | None
    model: str | None = None
    points: Path | None = None


def document_of(given: Given) -> dict[str, Any]:
    """The result document."""
    assert given.result is not None
    return read_document(given.result, form=FORMAT, version=VERSION)


def modes_from(given: Given) -> Modes:
    """The modes of the result.

    Raises:
        FileError: none, or nothing says in which units its shapes are.
    """
    units: dict[str, str] = {}
    if given.recording is not None:
        units = {channel.name: channel.unit for channel in load(given.recording, lazy=True).outputs}
    try:
        return modes_in(document_of(given), units)
    except FileError as error:
        raise FileError(f"{given.result}: {error}") from None


def data_of(given: Given) -> tuple[Recording | None, FrequencyResponse | None]:
    """The recording, or None, and the frequency responses, or None."""
    assert given.recording is not None
    response = load_responses(given.recording) if has_responses(given.recording) else None
    try:
        return load(given.recording), response
    except FileError:
        if response is None:
            raise
        return None, response


def samples_of(given: Given, form: str) -> Recording:
    """The recording.

    Raises:
        FileError: there are frequency responses only, which `form` cannot hold.
    """
    recording, _ = data_of(given)
    if recording is None:
        raise FileError(f"{given.recording}: holds frequency responses only; export them to .uff, not {form}")
    return recording
