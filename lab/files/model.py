"""A model, by its file or by its name."""

from __future__ import annotations

from pathlib import Path

from lab import catalogue
from lab.errors import RigError
from lab.rig import Rig


def load_model(model: str | Path) -> Rig:
    """The rig that an MJCF file describes, or a name from `lab list models`.

    Args:
        model: file, or name in the catalogue.

    Raises:
        UnknownNameError: there is neither a file nor a model of that name.
        RigError: MuJoCo does not compile it, or it is no structure; tells the file.
    """
    path = Path(model) if Path(model).exists() else catalogue.find("models", str(model))
    try:
        return Rig.load(path)
    except RigError as error:
        raise RigError(f"{error} (in {path})") from None
