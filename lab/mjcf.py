"""MJCF text in and out: what the user wrote stays as it was written, to the last digit.

MuJoCo's own XML writer rounds numbers to six digits, so a rig keeps and edits the text itself.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

from lab.errors import FileError, RigError


def read(path: Path) -> str:
    """The MJCF file as one text, with its includes put in place.

    Raises:
        FileError: the file, or one that it includes, cannot be read.
        RigError: it is no XML, or includes a file twice.
    """
    root = parse(_text(path), str(path))
    _expand_includes(root, path.parent, {path.resolve()})
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
    with quiet():
        try:
            spec = mujoco.MjSpec.from_string(xml if folder is None else _with_anchored_models(xml, folder))
            if folder is not None:
                spec.modelfiledir = str(folder)
            return spec.compile()
        except (ValueError, OSError) as error:
            reason = " ".join(str(error).split())
            raise RigError(f"MuJoCo refuses {source}: {reason}") from None


@contextmanager
def quiet() -> Iterator[list[str]]:
    """Collects MuJoCo's warnings, which it would write to a log file in the working directory."""
    complaints: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(complaints.append)
    try:
        yield complaints
    finally:
        mujoco.set_mju_user_warning(before)


def anchor(root: ET.Element, folder: Path) -> None:
    """Makes the paths of all files absolute that a model in `folder` names, so that its text can go elsewhere."""
    _anchor_models(root, folder)
    if not root.findall(".//*[@file]"):
        return
    where = {"meshdir": "", "texturedir": ""}
    compilers = root.findall("compiler") or [ET.Element("compiler")]
    for compiler in compilers:
        shared = compiler.attrib.pop("assetdir", None)
        for key in where:
            given = compiler.attrib.pop(key, shared)
            where[key] = where[key] if given is None else given
    if root.find("compiler") is None:
        root.insert(0, compilers[0])
    for key, value in where.items():
        compilers[-1].set(key, str(folder / value))


def number(value: float) -> str:
    """A number that reads back to the same double."""
    return repr(float(value))


def _with_anchored_models(xml: str, folder: Path) -> str:
    """The text with absolute paths of sub-models, which MuJoCo reads before it can be told the folder."""
    if "<model" not in xml:
        return xml
    root = parse(xml)
    _anchor_models(root, folder)
    return to_text(root)


def _anchor_models(root: ET.Element, folder: Path) -> None:
    for model in root.iterfind("asset/model[@file]"):
        model.set("file", str(folder / model.get("file", "")))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise FileError(
            f"model file {path} does not exist; expected the path of an MJCF (.xml) file"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"model file {path} cannot be read ({error}); expected an MJCF (.xml) file") from None


def _expand_includes(element: ET.Element, folder: Path, read_files: set[Path]) -> None:
    """Puts included files in place; as in MuJoCo, paths are seen from the main file, and a file is included once."""
    for position, child in reversed(list(enumerate(element))):
        if child.tag != "include":
            _expand_includes(child, folder, read_files)
            continue
        name = child.get("file")
        if not name:
            raise RigError('an <include> names no file; expected <include file="…"/>')
        path = (folder / name).resolve()
        if path in read_files:
            raise RigError(
                f"{name} is included a second time; MuJoCo allows it once, so remove one or the circle"
            )
        read_files.add(path)
        included = parse(_text(path), str(path))
        _expand_includes(included, folder, read_files)
        element.remove(child)
        for part in reversed(list(included)):
            element.insert(position, part)


def free_name(root: ET.Element, name: str) -> str:
    """The name, or where an element has it, the name with the first number behind a # that none has."""
    taken = {element.get("name") for element in root.iter()}
    return next(
        each for each in (name, *(f"{name}#{i}" for i in range(2, len(taken) + 3))) if each not in taken
    )
