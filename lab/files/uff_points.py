"""Points of universal files: a node and a direction, written like 12+X."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

DIRECTIONS = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}
DIRECTIONS |= {-code: name.replace("+", "-") for code, name in DIRECTIONS.items() if code}
"""Code of a direction: how it is written; none for a scalar."""

_LABEL = re.compile(r"(?:^|\s)(\d+)([+-]R?[XYZ])$")


def label_of(each: Mapping[str, Any], end: str) -> str:
    """How the response ("rsp") or reference ("ref") point of a function is called."""
    entity = str(each.get(f"{end}_ent_name", "")).strip()
    node, code = int(each[f"{end}_node"]), int(each[f"{end}_dir"])
    direction = DIRECTIONS.get(code, f" direction {code}")
    if entity.upper() not in ("", "NONE"):
        return f"{entity} {node}{direction}" if node or code else entity
    return f"{node}{direction}"


def point_of(name: str) -> tuple[int, int] | None:
    """Node and code of the direction that a channel name like "force 12+X" ends in, or None."""
    match = _LABEL.search(name)
    if match is None:
        return None
    return int(match[1]), next(code for code, text in DIRECTIONS.items() if text == match[2])
