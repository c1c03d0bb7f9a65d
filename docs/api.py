"""The API reference, made of docstrings: `python docs/api.py out/api` writes HTML pages, one per module.

It needs nothing that the lab does not need itself. `index.html` has the front doors `lab` and `identification` first, then
every module with its first sentence.
"""

from __future__ import annotations

import html
import importlib
import inspect
import pkgutil
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

PACKAGES = ("lab", "identification")
SECTIONS = ("Args", "Returns", "Raises", "Attributes", "Source")
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 52rem; margin: 2rem auto; padding: 0 1rem; }
code, pre { font-family: ui-monospace, monospace; font-size: 0.9em; }
pre { background: #f4f4f4; padding: 0.6rem; overflow-x: auto; }
h2, h3 { margin-top: 2.5rem; border-top: 1px solid #ccc; padding-top: 0.5rem; }
h4 { margin-bottom: 0; } dt { font-weight: 600; } dd { margin-left: 1.5rem; } .member { margin-left: 1.5rem; }
@media (prefers-color-scheme: dark) {
  body { background: #161616; color: #ddd; } pre { background: #262626; } a { color: #8ab4f8; }
}
"""


def modules() -> Iterator[ModuleType]:
    """Every public module of the packages, in alphabetical order, packages before what is in them."""
    for package in PACKAGES:
        root = importlib.import_module(package)
        yield root
        for found in sorted(pkgutil.walk_packages(root.__path__, f"{package}."), key=lambda each: each.name):
            if not any(part.startswith("_") for part in found.name.split(".")):
                yield importlib.import_module(found.name)


def members(module: ModuleType) -> dict[str, Any]:
    """Public functions and classes that a module defines, in the order of its text."""
    own = {
        name: value
        for name, value in vars(module).items()
        if not name.startswith("_")
        and (inspect.isfunction(value) or inspect.isclass(value))
        and value.__module__ == module.__name__
    }
    return dict(sorted(own.items(), key=lambda item: inspect.getsourcelines(item[1])[1]))


def own_members(kind: type) -> Iterator[tuple[str, Any]]:
    """Public methods and properties that a class defines itself and describes."""
    for name, value in vars(kind).items():
        function = getattr(value, "fget", None) or getattr(value, "func", None) or value
        function = getattr(function, "__func__", function)
        if not name.startswith("_") and inspect.isfunction(function) and function.__doc__:
            yield name, value


def signature(value: Any) -> str:
    """How a function or class is called, without the types, which the text tells in words."""
    try:
        found = inspect.signature(value)
    except ValueError:
        return ""
    parts = [
        each.replace(annotation=inspect.Parameter.empty)
        for each in found.parameters.values()
        if each.name not in ("self", "cls")
    ]
    text = str(found.replace(parameters=parts, return_annotation=inspect.Signature.empty))
    return re.sub(r"<(?:function|class|factory) ?'?([\w.]*)[^>]*>", r"\1", text)


def described(text: str) -> str:
    """A docstring in Google form as HTML."""
    blocks, out = re.split(r"\n\s*\n", inspect.cleandoc(text)), []
    for block in blocks:
        head, colon, rest = block.partition(":")
        if colon and head in SECTIONS:
            out.append(f"<h4>{head}</h4>{section(head, rest)}")
        elif re.match(r" {4}", block):
            out.append(f"<pre>{html.escape(inspect.cleandoc(block))}</pre>")
        else:
            out.append(f"<p>{prose(block)}</p>")
    return "\n".join(out)


def section(head: str, text: str) -> str:
    """Entries `name: what it is` as a list, anything else as a paragraph."""
    text = inspect.cleandoc(text) if text.startswith("\n") else " ".join(text.split())
    entries = re.split(r"\n(?=\S)", text)
    if head in ("Returns", "Source") or not all(re.match(r"[\w*, ]+:", entry) for entry in entries):
        return f"<p>{prose(text)}</p>"
    pairs = (entry.partition(":") for entry in entries)
    return (
        "<dl>" + "".join(f"<dt>{html.escape(n)}</dt><dd>{prose(what)}</dd>" for n, _, what in pairs) + "</dl>"
    )


def prose(text: str) -> str:
    """A paragraph with its `code` marked."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(" ".join(text.split()), quote=False))


def entry(name: str, value: Any) -> str:
    """One function or class, with the members of a class."""
    parts = [
        f'<h3 id="{name}">{name}</h3>',
        f"<pre>{html.escape(name + signature(value))}</pre>",
        described(value.__doc__ or ""),
    ]
    for each, member in own_members(value) if inspect.isclass(value) else ():
        called = (
            html.escape(signature(getattr(member, "__func__", member)))
            if callable(member) or hasattr(member, "__func__")
            else ""
        )
        parts.append(
            f'<div class="member"><h4><code>{each}{called}</code></h4>{described(member.__doc__)}</div>'
        )
    return "\n".join(parts)


def page(title: str, body: str) -> str:
    """A whole HTML page."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def first_sentence(text: str | None) -> str:
    """What a name is, in its first line."""
    return prose((text or "").strip().split("\n\n")[0])


def front_door(package: ModuleType) -> str:
    """The names that a package offers, each with its first sentence and a link."""
    rows = []
    for name in package.__all__:
        value = getattr(package, name)
        where = getattr(value, "__module__", None)
        if where is None or not (inspect.isfunction(value) or inspect.isclass(value)):
            rows.append(
                f"<li><code>{package.__name__}.{name}</code>: by name, {', '.join(map(str, value))}</li>"
            )
            continue
        link = f'<a href="{where}.html#{value.__name__}"><code>{package.__name__}.{name}</code></a>'
        rows.append(f"<li>{link}: {first_sentence(value.__doc__)}</li>")
    return f"<h2>{package.__name__}</h2>{described(package.__doc__ or '')}<ul>{''.join(rows)}</ul>"


def write(folder: Path) -> int:
    """Writes all pages into a folder and gives their number."""
    folder.mkdir(parents=True, exist_ok=True)
    listed = []
    for module in modules():
        name = module.__name__
        body = [f'<p><a href="index.html">index</a></p><h1>{name}</h1>', described(module.__doc__ or "")]
        body += [entry(each, value) for each, value in members(module).items()]
        (folder / f"{name}.html").write_text(page(name, "\n".join(body)), encoding="utf-8")
        listed.append(
            f'<li><a href="{name}.html"><code>{name}</code></a>: {first_sentence(module.__doc__)}</li>'
        )
    doors = "".join(front_door(importlib.import_module(package)) for package in PACKAGES)
    body = f"<h1>API reference</h1>{doors}<h2>All modules</h2><ul>{''.join(listed)}</ul>"
    (folder / "index.html").write_text(page("API reference", body), encoding="utf-8")
    return len(listed) + 1


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python docs/api.py FOLDER")
    print(f"{write(Path(sys.argv[1]))} pages; begin with {sys.argv[1]}/index.html")
