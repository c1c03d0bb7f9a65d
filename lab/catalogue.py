"""What the lab brings along: models, scenarios, methods, effects, each with one line that says what it is."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from lab.errors import UnknownNameError

KINDS = ("models", "scenarios", "methods", "effects")


def folder(kind: str) -> Path:
    """Where the models or the scenarios lie: inside an installed package, or at the top of a checkout."""
    package = Path(__file__).parent
    installed = package / "data" / kind
    return installed if installed.is_dir() else package.parent / kind


def files(kind: str) -> dict[str, Path]:
    """Models or scenarios by name."""
    suffix = {"models": ".xml", "scenarios": ".toml"}[kind]
    return {path.stem: path for path in sorted(folder(kind).glob(f"*{suffix}"))}


def find(kind: str, name: str) -> Path:
    """The model or scenario of that name, with or without its suffix.

    Raises:
        UnknownNameError: there is none.
    """
    known = files(kind)
    path = known.get(Path(name).stem) if Path(name).name == name else None
    if path is None or Path(name).suffix not in ("", path.suffix):
        listed = ", ".join(known) or "none"
        raise UnknownNameError(
            f"{kind[:-1]} {name!r} is neither a file nor in the catalogue; there are {listed}"
        )
    return path


def listing(kind: str) -> dict[str, str]:
    """Name and one line of description for each model, scenario, method or effect."""
    if kind == "models":
        return {name: _first_comment(path) for name, path in files(kind).items()}
    if kind == "scenarios":
        return {name: tomllib.loads(path.read_text("utf-8"))["title"] for name, path in files(kind).items()}
    if kind == "methods":
        from identification.methods import METHODS

        return {name: method.summary for name, method in METHODS.items()}
    from lab.effects import EFFECTS

    return {name: _first_sentence(effect.__doc__ or "") for name, effect in EFFECTS.items()}


def _first_comment(path: Path) -> str:
    found = re.search(r"<!--(.*?)-->", path.read_text("utf-8"), re.DOTALL)
    # Which program wrote a model says nothing of the structure.
    return re.sub(r"^Written by \S+\.py\. ", "", " ".join(found[1].split())) if found else ""


def _first_sentence(text: str) -> str:
    return text.strip().split("\n\n")[0].replace("\n", " ")
