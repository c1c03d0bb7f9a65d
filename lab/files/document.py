"""Documents in JSON: plain values only, written whole or not at all, checked for format and version when read."""

from __future__ import annotations

import json
import math
import os
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lab.errors import FileError


def plain(value: Any) -> Any:
    """The value as dicts, lists, numbers and texts; None for a number that is not finite."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    return value


def write_document(document: Mapping[str, Any], path: str | Path) -> None:
    """Writes JSON; an existing file is replaced once the new one is whole.

    Raises:
        FileError: the file cannot be written.
    """
    path = Path(path)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    hidden = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")
    try:
        hidden.write_text(text + "\n", encoding="utf-8")
        os.replace(hidden, path)
    except OSError as error:
        hidden.unlink(missing_ok=True)
        raise FileError(
            f"{path}: cannot be written ({error.strerror}); choose a folder that can be"
        ) from None


def read_document(path: str | Path, *, form: str, version: int, keys: Sequence[str] = ()) -> dict[str, Any]:
    """The document in a JSON file of that format and version, with at least these keys.

    Raises:
        FileError: no such file, not JSON, of another format or version, or incomplete.
    """
    path = Path(path)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(
            f"{path}: cannot be read ({error.strerror}); expected a file of format {form!r}"
        ) from None
    except ValueError as error:
        raise FileError(f"{path}: is not JSON ({error}); expected a file of format {form!r}") from None
    given = (document.get("format"), document.get("version")) if isinstance(document, dict) else (None, None)
    if given != (form, version):
        raise FileError(
            f"{path}: is of format {given[0]!r} version {given[1]!r}; expected {form!r} version {version}"
        )
    missing = [key for key in keys if key not in document]
    if missing:
        raise FileError(f"{path}: has no {missing[0]!r}; expected {', '.join(keys)}")
    return dict(document)
