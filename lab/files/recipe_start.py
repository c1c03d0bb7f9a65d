"""A recipe to start from: what a file shows, and the questions that it leaves open."""

from __future__ import annotations

import json
from collections.abc import Iterable

from lab.errors import FileError
from lab.files.importing_columns import Source
from lab.files.units import to_si

OPEN = "?"
"""Stands for what only the user knows; the recipe is refused until it is replaced."""

_MOST = 64
"""Channels listed."""


def starting_recipe(source: Source) -> str:
    """A recipe (TOML) in which "?" stands where the file is silent, under the file's first lines as comments."""
    shown = (f"#   {line.rstrip()}" for line in source.preview)
    head = [
        f"# {source.path.name} shows:",
        *shown,
        "#",
        f"# Replace every {OPEN} by what is known, then: lab import FILE --recipe RECIPE.toml",
    ]
    names = list(source.columns)
    frequency = next((name for name in names if name.lower().startswith("freq")), None)
    body = _responses(source, frequency) if frequency else _samples(source)
    return "\n".join([*head, *body]) + "\n"


def _samples(source: Source) -> list[str]:
    names = list(source.columns)
    time = next((name for name in names if name.lower() in ("t", "time", "time_s", "zeit")), None)
    lines = ["", 'kind = "other"  # pulse, impact, random, sweep, ambient, free_decay, …']
    if time is not None:
        lines.append(f"time = {_quoted(time)}")
    elif not source.sample_rate:
        choice = f"  # Hz, or one of {', '.join(source.scalars)}" if source.scalars else "  # Hz"
        lines.append(f'sample_rate = "{OPEN}"{choice}')
    if source.unclear:
        shapes = ", ".join(f"{name} {shape}" for name, shape in source.unclear.items())
        lines += ["", "[arrays]", f'samples = "{OPEN}"  # "rows" or "columns" of {shapes}']
        names += [f"{name}[{k}]" for name, shape in source.unclear.items() for k in range(1, min(shape) + 1)]
    if not source.named:
        listed = ", ".join(_quoted(name) for name in names)
        lines += ["", "[table]", f"columns = [{listed}]  # names, in the order of the file"]
    for name in names[:_MOST]:
        if name != time:
            lines += _channel(source, name)
    return lines


def _channel(source: Source, name: str) -> list[str]:
    unit = source.units.get(name, OPEN)
    side = source.sides.get(name) or ("input" if _is_force(unit) else "output")
    sure = "" if source.sides.get(name) else '  # or "inputs", or leave the channel out'
    # A unit of the recipe would replace that of the file, whose numbers may be converted already.
    last = f"# in {unit}, as the file states" if name in source.units else f"unit = {_quoted(OPEN)}"
    return ["", f"[[{side}s]]{sure}", f"name = {_quoted(name)}", last]


def _responses(source: Source, frequency: str) -> list[str]:
    def named(*words: str) -> str:
        return next((name for name in source.columns if name.lower().startswith(words)), OPEN)

    form = _keys(magnitude=named("mag", "amp"), phase=named("pha"), magnitude_unit=OPEN, phase_unit=OPEN)
    return [
        "",
        "[frequency]",
        *_keys(column=frequency, unit=OPEN),
        *("", "[[inputs]]", *_keys(name="force", unit=OPEN)),
        *("", "[[outputs]]", *_keys(name="response", unit=OPEN)),
        *("", "[[responses]]", *_keys(output="response", input="force"), *form),
    ]


def _keys(**values: str) -> Iterable[str]:
    return [f"{key} = {_quoted(value)}" for key, value in values.items()]


def _is_force(unit: str) -> bool:
    try:
        return to_si(unit)[0] == "N"
    except FileError:
        return False


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
