"""Numbers picked from result.json and diagnosis.json by dotted paths."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from lab.errors import StudyError
from lab.files.diagnosis import KEYS as DIAGNOSIS_KEYS

RESULT_KEYS = (
    "method",
    "order",
    "settings",
    "sample_rate",
    "modes",
    "second_order",
    "truth",
    "comparison",
    "criteria",
    "validation",
    "warnings",
    "notes",
    "explanation",
    "refinement",
)
DOCUMENTS = {"result": RESULT_KEYS, "diagnosis": (*DIAGNOSIS_KEYS, "noise", "unlearnable")}
"""What a path may begin with, and what may follow."""


def check_collected(paths: Mapping[str, str]) -> None:
    """Refuses names that no column can have and paths that begin nowhere.

    Raises:
        StudyError: with what is allowed.
    """
    for name, path in paths.items():
        if not re.fullmatch(r"[A-Za-z]\w*", name):
            raise StudyError(f"name {name!r} in [collect]; expected a letter, then letters, digits and _")
        document, _, rest = path.partition(".")
        if document not in DOCUMENTS:
            raise StudyError(
                f"{name} = {path!r} in [collect]; expected a path that begins with result. or diagnosis."
            )
        key = rest.partition(".")[0]
        if key not in DOCUMENTS[document]:
            allowed = ", ".join(DOCUMENTS[document])
            raise StudyError(
                f"{name} = {path!r} in [collect]: no key {key!r} in {document}.json; allowed are {allowed}"
            )


def picked(documents: Mapping[str, Any], path: str) -> float | str | None:
    """The number or text at the end of a path; None where the run has nothing there.

    Raises:
        StudyError: a table or list is there.
    """
    here: Any = documents
    for key in path.split("."):
        if isinstance(here, list):
            here = here[int(key)] if key.isdecimal() and int(key) < len(here) else None
        else:
            here = here.get(key) if isinstance(here, Mapping) else None
    if isinstance(here, Mapping | list):
        known = list(here) if isinstance(here, Mapping) else [f"0 to {len(here) - 1}"]
        raise StudyError(
            f"{path!r} in [collect] leads to a table or list, not to a number; go on with one of "
            f"{', '.join(known)}"
        )
    return float(here) if isinstance(here, int | float) else here
