"""MJCF text in and out: what the user wrote stays as it was written, to the last digit.

MuJoCo's own XML writer rounds numbers to six digits, so a rig keeps and edits the text itself.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco

from lab.errors import FileError, RigError


def read(path: Path) -> str:
    """The MJCF file as one text, with its includes put in place.

    Raises:
        FileError: the file cannot be read.
        RigError: it is no XML.
    """
    root = parse(_text(path), str(path))
    _expand_includes(root, path.parent, (path.resolve(),))
    return to_text(root)


def parse(xml: str, source: str = "the model") -> ET.Element:
    """The root element of an MJCF text.

    Raises:
        RigError: not well-formed, or the root is not `mujoco`.
    """
    builder = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))
    try:
        root = ET.fromstring(xml, parser=builder)
    except ET.ParseError as error:
        raise RigError(f"{source} is not well-formed XML ({error}); expected an MJCF file") from None
    if root.tag not in ("mujoco", "mujocoinclude"):
        raise RigError(
            f"{source} has the root element <{root.tag}>; expected <mujoco>, the root of an MJCF file"
        )
    return root


def to_text(root: ET.Element) -> str:
    """The MJCF text of a root element."""
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def compiled(xml: str, folder: Path | None, source: str) -> mujoco.MjModel:
    """The model that MuJoCo makes of an MJCF text, with relative files looked up in `folder`.

    Raises:
        RigError: MuJoCo refuses it; MuJoCo's reason in one line.
    """
    try:
        spec = mujoco.MjSpec.from_string(xml)
        if folder is not None:
            spec.modelfiledir = str(folder)
        return spec.compile()
    except (ValueError, OSError) as error:
        reason = " ".join(str(error).split())
        raise RigError(f"MuJoCo refuses {source}: {reason}") from None


def number(value: float) -> str:
    """A number that reads back to the same double."""
    return repr(float(value))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise FileError(
            f"model file {path} does not exist; expected the path of an MJCF (.xml) file"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"model file {path} cannot be read ({error}); expected an MJCF (.xml) file") from None


def _expand_includes(element: ET.Element, folder: Path, open_files: tuple[Path, ...]) -> None:
    for position, child in reversed(list(enumerate(element))):
        if child.tag == "include":
            path = (folder / child.get("file", "")).resolve()
            if path in open_files:
                raise RigError(
                    f"{open_files[-1].name} includes {path.name}, which is open already; remove the circle"
                )
            included = parse(_text(path), str(path))
            _expand_includes(included, folder, (*open_files, path))
            element.remove(child)
            for part in reversed(list(included)):
                element.insert(position, part)
        else:
            _expand_includes(child, folder, open_files)
