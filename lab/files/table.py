"""Text tables (CSV, TSV, columns between blanks) -> columns: header, delimiter and units only where the file is clear."""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lab.errors import FileError
from lab.files.importing_columns import Source
from lab.files.recipe_parts import TablePart
from lab.files.units import to_si

DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "space": None}
"""Name: what stands between columns; None for any run of blanks."""

_NAMED_UNIT = re.compile(r"^(?P<name>.+?)\s*[\[(](?P<unit>[^\[\]()]+)[\])]$")
_PLAIN = TablePart()
_LOOK = 50
"""Lines in which the layout is looked for."""


def read_table(path: Path, part: TablePart) -> Source:
    """The columns of a text table, packed by gzip or not.

    A line of names may stand before the numbers, with units in brackets behind the names or in a line below.

    Args:
        path: the file.
        part: how it is written, as far as the file itself leaves it open.

    Raises:
        FileError: not text, no numbers, lines of different lengths, a word among numbers, or two delimiters fit.
    """
    lines = _lines(path)
    preview = tuple(line[:120] for line in lines[:6])
    first = _first_numbers(lines, part)
    delimiter = _delimiter(lines[first:], part)
    values = _numbers(lines, first, delimiter, part)  # (n_rows, n_columns)
    header = [_fields(line.lstrip("#% "), delimiter) for line in lines[:first] if line.strip()]
    names, units = _names(header, values.shape[1], part)
    # Equal names would hide a column.
    double = next((name for name in names if names.count(name) > 1), None)
    if double is not None:
        raise FileError(f"column {double!r} appears twice; name the columns in [table] columns")
    named = part.columns is not None or bool(header and len(header[-1]) == values.shape[1])
    columns = dict(zip(names, values.T, strict=True))
    return Source(path, columns, units, named=named, preview=preview)


def _lines(path: Path) -> list[str]:
    try:
        raw = path.read_bytes()
        if raw[:2] == b"\x1f\x8b":
            raw = gzip.decompress(raw)
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or "damaged gzip file"
        raise FileError(f"cannot be read ({reason})") from None
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = raw.decode("utf-16", errors="replace")
    elif b"\0" in raw:
        raise FileError("is not text; expected a table of numbers")
    else:
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("latin-1")
    lines = re.split(r"\r\n|\r|\n", text)
    while lines and not lines[-1].strip():
        lines.pop()
    return lines


def _fields(line: str, delimiter: str | None, part: TablePart = _PLAIN) -> list[str]:
    fields = [field.strip().strip('"').strip() for field in line.strip("\r\n ").split(delimiter)]
    # Many loggers end every line with a delimiter.
    ended = delimiter is not None and len(fields) > 1 and not fields[-1] and "" not in part.missing
    return fields[:-1] if ended else fields


def _is_number(text: str, part: TablePart) -> bool:
    if text in part.missing:
        return True
    try:
        float(text.replace(",", ".") if part.decimal == "," else text)
    except ValueError:
        return False
    return "_" not in text


def _numeric(line: str, delimiter: str | None, part: TablePart) -> bool:
    fields = _fields(line, delimiter, part)
    return bool(fields) and all(_is_number(field, part) for field in fields)


def _fitting(line: str, part: TablePart) -> list[str]:
    """Names of the delimiters with which the whole line is numbers."""
    names = [part.delimiter] if part.delimiter else list(DELIMITERS)
    return [name for name in names if line.strip() and _numeric(line, DELIMITERS[name], part)]


def _first_numbers(lines: Sequence[str], part: TablePart) -> int:
    """Index of the first line of numbers."""
    if part.header_lines is not None:
        if part.header_lines >= len(lines):
            raise FileError(f"has {len(lines)} lines; header_lines = {part.header_lines} leaves no numbers")
        return part.header_lines
    for number, line in enumerate(lines[: 20 * _LOOK]):
        if _fitting(line, part):
            return number
    wanted = f" between delimiters {part.delimiter!r}" if part.delimiter else ""
    raise FileError(
        f"holds no line of numbers{wanted} with decimal sign {part.decimal!r}; expected a table, "
        "see decimal, delimiter and missing in [table]"
    )


def _delimiter(lines: Sequence[str], part: TablePart) -> str | None:
    """What stands between columns: stated, or the only one with which the first lines are numbers."""
    if part.delimiter:
        return DELIMITERS[part.delimiter]
    first = _fitting(lines[0], part)
    looked = [line for line in lines[:_LOOK] if line.strip()]
    # Where none fits all lines, the first tells the delimiter, and a later line is at fault.
    fits = [name for name in first if all(_numeric(line, DELIMITERS[name], part) for line in looked)] or first
    widths = {name: len(_fields(lines[0], DELIMITERS[name])) for name in fits}
    # Blanks round a true delimiter, or a lone column, fit in several ways that mean the same.
    best = [name for name in fits if widths[name] == max(widths.values())]
    if not best:
        raise FileError("has no delimiter that fits its first lines; say delimiter and decimal in [table]")
    if part.decimal == "," and "comma" in best:
        best = [name for name in best if name != "comma"] or best
    return DELIMITERS[best[0]]


def _numbers(lines: list[str], first: int, delimiter: str | None, part: TablePart) -> np.ndarray:
    rows = [_cleaned(line, delimiter, part) for line in lines[first:]]
    # The fast reader skips empty lines without a word; here they would shift time.
    empty = next((number for number, row in enumerate(rows) if not row.strip()), None)
    if empty is not None:
        raise FileError(f"line {first + empty + 1} is empty in the middle of the numbers")
    try:
        return np.loadtxt(rows, delimiter=delimiter, ndmin=2, comments=None, dtype=np.float64)
    except ValueError:
        raise FileError(_what_is_wrong(rows, first, delimiter, part)) from None


def _cleaned(line: str, delimiter: str | None, part: TablePart) -> str:
    if part.missing or '"' in line:
        fields = ["nan" if field in part.missing else field for field in _fields(line, delimiter, part)]
        line = (delimiter or " ").join(fields)
    line = line.strip(" \r\n")
    if delimiter is not None and line.endswith(delimiter):
        line = line[: -len(delimiter)]
    return line.replace(",", ".") if part.decimal == "," else line


def _what_is_wrong(rows: Sequence[str], first: int, delimiter: str | None, part: TablePart) -> str:
    width = len(_fields(rows[0], delimiter))
    plain = TablePart(missing=["nan"])
    for number, row in enumerate(rows, first + 1):
        fields = _fields(row, delimiter)
        if len(fields) != width:
            return f"line {number} has {len(fields)} columns; expected {width} as in the lines before"
        for field in fields:
            if not _is_number(field, plain):
                return f"line {number} holds {field!r}; expected a number, see missing and decimal in [table]"
    return "cannot be read as numbers"


def _names(header: list[list[str]], n: int, part: TablePart) -> tuple[list[str], dict[str, str]]:
    """Names of the columns, and the units that stand with them."""
    if part.columns is not None:
        if len(part.columns) != n:
            raise FileError(f"has {n} columns; [table] columns names {len(part.columns)}")
        return part.columns, {}
    fitting = [line for line in header if len(line) == n]
    if not fitting or fitting[-1] != header[-1]:
        return [f"column {k}" for k in range(1, n + 1)], {}
    if len(fitting) > 1 and all(_is_unit(text) for text in fitting[-1]):
        names, below = fitting[-2], fitting[-1]
        return names, dict(zip(names, (text.strip("[]()") for text in below), strict=True))
    units = {}
    names = []
    for text in fitting[-1]:
        match = _NAMED_UNIT.match(text)
        known = match is not None and _is_unit(match["unit"])
        names.append(match["name"] if match and known else text)
        if match and known:
            units[names[-1]] = match["unit"]
    return names, units


def _is_unit(text: str) -> bool:
    try:
        to_si(text.strip("[]() "))
    except FileError:
        return text.strip("[]() ") in ("s", "Hz", "ms")
    return True
