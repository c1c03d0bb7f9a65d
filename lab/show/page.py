"""What all pages share: one look, escaped text, inline drawings, versions and checksums.

The only place that imports jinja2. All that comes from data is escaped.
"""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from lab.files.checksum import sha256_of
from lab.show.figures.canvas import Drawing

PACKAGES = ("virtual-modal-lab", "mujoco", "numpy", "scipy", "h5py")
"""What the numbers depend on."""


def template(name: str) -> jinja2.Template:
    """The template of that file name."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=_visible,
    )
    return environment.get_template(name)


def _visible(value: Any) -> Any:
    """Text without the characters that HTML forbids; markup of our own as it is."""
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return "".join(c if c.isprintable() or c in "\n\t" else "\N{REPLACEMENT CHARACTER}" for c in value)


def inline(drawing: Drawing) -> dict[str, Any]:
    """A drawing as the templates take it."""
    # The SVG is ours: its texts were escaped when it was written.
    return {"name": drawing.name, "svg": Markup(drawing.svg), "caption": drawing.caption}


def surroundings() -> dict[str, str]:
    """What the numbers were computed with."""
    return {
        "Versions": ", ".join(_versions(PACKAGES)),
        "Machine": f"{platform.system()} {platform.machine()}",
    }


def checksums(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """SHA-256 of those of the named files that lie in the folder."""
    return {f"SHA-256 of {name}": sha256_of(folder / name) for name in names if (folder / name).is_file()}


def _versions(packages: Iterable[str]) -> list[str]:
    versions = [f"Python {platform.python_version()}"]
    for name in packages:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"{name} not installed as a package")
    return versions
