"""From matplotlib to clean inline SVG: one look for all figures, text kept as text, no clashing names."""

from __future__ import annotations

import io
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter, NullLocator

WIDTH = 6.7
"""Of every figure [inch]: the text width of A4 with margins of 20 mm."""
DASHES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1, 1)),
    (0, (6, 1.5, 1, 1.5)),
    (0, (3, 1, 1, 1, 1, 1)),
    (0, (8, 3)),
)
"""Line styles that stay apart in black and white."""
FEW_DECADES = 1e3
"""Ratio of the ends of a logarithmic axis beyond which ticks between the decades would be a blur."""
LOOK: Any = {
    "svg.fonttype": "none",
    "font.family": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 8.0,
    "lines.linewidth": 1.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "path.simplify_threshold": 0.2,
}


REPLACEMENT = "\N{REPLACEMENT CHARACTER}"


@dataclass(frozen=True)
class Drawing:
    """A figure of the report.

    Attributes:
        name: short and unique, the prefix of all names inside.
        svg: an <svg> element to put into HTML.
        caption: what there is to see, in words.
    """

    name: str
    svg: str
    caption: str


def drawing(name: str, height: float, caption: str, paint: Callable[[Figure], None]) -> Drawing:
    """What `paint` puts on a figure, as SVG; the same data give the same bytes."""
    with matplotlib.rc_context({**LOOK, "svg.hashsalt": name}):
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        paint(figure)
        text = io.StringIO()
        # `savefig` would draw everything once more beforehand, for the sake of the layout, which drawing brings about too.
        FigureCanvasSVG(figure).print_svg(text, metadata={"Date": None})
    return Drawing(name, clean(text.getvalue(), name, caption), caption)


def clean(text: str, name: str, title: str) -> str:
    """An SVG document as an element for HTML: no namespaces or metadata, names prefixed, numbers short."""
    root = ET.fromstring(text)
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag.endswith(("}metadata", "}style")):
                parent.remove(child)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        for key, value in list(element.attrib.items()):
            del element.attrib[key]
            element.set(key.rpartition("}")[2], _attribute(element.tag, key, value, name))
    for element in root.iter():
        element.text = None if element.text is None else _restored(element.text)
    root.attrib = {
        "viewBox": root.get("viewBox", ""),
        "role": "img",
        "aria-label": title,
        "stroke-linejoin": "round",
        "stroke-linecap": "butt",
    }
    return ET.tostring(root, encoding="unicode")


def _attribute(tag: str, key: str, value: str, name: str) -> str:
    if key == "id":
        return f"{name}-{value}"
    if key.endswith("href") and value.startswith("#"):
        return f"#{name}-{value[1:]}"
    if "url(#" in value:
        return value.replace("url(#", f"url(#{name}-")
    if key in ("d", "points", "x", "y"):
        return re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number.group()):.2f}", value)
    return value


def plain(text: str, longest: int = 30) -> str:
    """Text that matplotlib draws as it is, cut in the middle when longer: no formula, no forbidden character."""
    if len(text) > longest:
        text = f"{text[: longest // 2]}…{text[len(text) - (longest - 1) // 2 :]}"
    visible = "".join(c if c.isprintable() else REPLACEMENT for c in text)
    return "".join(c if _drawable(c) else _stand_in(c) for c in visible).replace("$", r"\$")


def _drawable(character: str) -> bool:
    """Whether the drawing font has the character and it stands for itself."""
    if character.isascii():
        return True
    font = get_font(findfont(LOOK["font.family"][0]))
    return not 0x2800 <= ord(character) < 0x2900 and font.get_char_index(ord(character)) != 0


def _stand_in(character: str) -> str:
    """Two Braille patterns in place of a character that only the reader's browser can draw; about as wide."""
    code = ord(character) if ord(character) < 0x10000 else ord(REPLACEMENT)
    return chr(0x2800 + code // 256) + chr(0x2800 + code % 256)


def _restored(text: str) -> str:
    """Text with the characters that had stand-ins."""
    return re.sub(
        "[\u2800-\u28ff]{2}", lambda m: chr(256 * (ord(m[0][0]) - 0x2800) + ord(m[0][1]) - 0x2800), text
    )


def power_of_ten(value: float, _: int | None = None) -> str:
    """A tick on a logarithmic axis: 10⁻³ instead of a formula."""
    exponent = round(float(np.log10(value))) if value > 0 else 0
    return "10" + "".join("⁰¹²³⁴⁵⁶⁷⁸⁹"[int(c)] if c.isdigit() else "⁻" for c in str(exponent))


def stacked(figure: Figure, n_rows: int, n_columns: int = 1, **options: Any) -> np.ndarray:
    """Axes (n_rows, n_columns) of which each column has one x axis, shown at its foot."""
    frames: np.ndarray = figure.subplots(n_rows, n_columns, sharex="col", squeeze=False, **options)
    for axes in frames[:-1].ravel():
        axes.xaxis.set_visible(False)
    return frames


def logarithmic(axes: Axes) -> None:
    """A logarithmic y axis over at most eight decades below the largest value, with about four ticks."""
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    low = max(low, high * 1e-8)
    axes.set_ylim(low, high)
    if high > FEW_DECADES * low:
        axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(power_of_ten))
    axes.yaxis.set_minor_formatter(NullFormatter())


def decibel_axis(axes: Axes, label: str, *, factor: float) -> None:
    """A second scale on the right of a logarithmic axis whose limits stand: factor 10 for powers, 20 for magnitudes."""
    right = axes.twinx()
    low, high = axes.get_ylim()
    right.set_ylim(factor * np.log10(low), factor * np.log10(high))
    right.spines["right"].set_visible(True)
    right.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    right.yaxis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
    right.set_ylabel(label)


def few_ticks(axes: Axes, n: int) -> None:
    """About `n` round ticks on a linear y axis."""
    axes.yaxis.set_major_locator(MaxNLocator(n))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))


def mark_modes(axes: Axes, frequency_hz: np.ndarray, *, numbered: bool = True) -> None:
    """A dotted line at every mode, with its number on top where there is room."""
    low, high = axes.get_xlim()
    last = -np.inf
    for number, frequency in enumerate(frequency_hz, start=1):
        if not low <= frequency <= high:
            continue
        axes.axvline(frequency, color="0.45", linestyle=":", linewidth=0.8, zorder=0)
        if numbered and frequency - last > 0.025 * (high - low):
            axes.annotate(
                str(number),
                (frequency, 1),
                xycoords=("data", "axes fraction"),
                ha="center",
                va="bottom",
                color="0.3",
            )
            last = frequency
