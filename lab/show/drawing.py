"""Plots as plain lines and labels on a canvas, for viewers that have no X-Y plot, and their colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SERIES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F")
"""Line colours that stay apart for colour-blind eyes.

Source: Okabe and Ito (2008), Color Universal Design.
"""

DIVERGING = np.array(
    [
        [33, 60, 140],
        [67, 130, 195],
        [160, 200, 225],
        [240, 240, 240],
        [245, 185, 150],
        [215, 95, 75],
        [140, 20, 40],
    ]
)
"""Blue (negative), near white (zero), red (positive)."""


@dataclass(frozen=True)
class Axes:
    """A rectangle on a canvas (x to the right, y downwards) that stands for ranges of two quantities.

    Attributes:
        x: smallest and largest value, left to right.
        y: smallest and largest value, bottom to top.
        width: of the rectangle, in canvas units.
        height: likewise.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    width: float = 160.0
    height: float = 90.0

    def at(self, x: np.ndarray | Sequence[float], y: np.ndarray | Sequence[float]) -> np.ndarray:
        """Canvas points of values, shape (n, 2)."""
        right = (np.asarray(x, dtype=float) - self.x[0]) / (self.x[1] - self.x[0]) * self.width
        up = (np.asarray(y, dtype=float) - self.y[0]) / (self.y[1] - self.y[0]) * self.height
        return np.stack([right, self.height - up], axis=1)

    def frame(self) -> list[np.ndarray]:
        """The rectangle and a small stroke at every tick."""
        w, h = self.width, self.height
        across, up = self._ticks()
        box = np.array([[0, 0], [0, h], [w, h], [w, 0], [0, 0]], dtype=float)
        below = [
            np.array([[p, h], [p, h + 1.5]]) for p, _ in self.at(across, np.full(len(across), self.y[0]))
        ]
        beside = [np.array([[-1.5, p], [0, p]]) for _, p in self.at(np.full(len(up), self.x[0]), up)]
        return [box, *below, *beside]

    def tick_labels(self) -> tuple[np.ndarray, list[str]]:
        """Canvas points just below and beside the ticks of both axes, and their texts."""
        across, up = self._ticks()
        below = np.add(self.at(across, np.full(len(across), self.y[0])), (0.0, 2.0))
        beside = np.add(self.at(np.full(len(up), self.x[0]), up), (-9.0, -5.0))
        return np.concatenate([below, beside]), [f"{value:g}" for value in (*across, *up)]

    def _ticks(self) -> tuple[list[float], list[float]]:
        return ticks(*self.x, 8), ticks(*self.y, 5)


def ticks(low: float, high: float, n: int) -> list[float]:
    """At most about `n` round values (1, 2 or 5 times a power of ten apart) from `low` to `high`."""
    rough = (high - low) / n
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(s for s in (1, 2, 5, 10) if s * power >= rough * (1 - 1e-9))
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]


def round_range(values: np.ndarray) -> tuple[float, float]:
    """Smallest and largest value, widened to round ones; what is no number is left out."""
    known = values[np.isfinite(values)]
    if not known.size:
        return -0.5, 0.5
    low, high = float(np.min(known)), float(np.max(known))
    if not high > low:
        return low - 0.5, low + 0.5
    step = np.diff(ticks(low, high, 8))
    size = float(step[0]) if step.size else high - low
    return size * float(np.floor(low / size)), size * float(np.ceil(high / size))


def diverging(values: np.ndarray, limit: float) -> np.ndarray:
    """Colours of signed values, (*values.shape, 3) uint8: blue at -limit, near white at 0, red at +limit."""
    level = np.clip(np.nan_to_num(np.asarray(values, dtype=float)) / (limit or 1.0), -1, 1)
    return _interpolate((level + 1) / 2, DIVERGING)


def sequential(values: np.ndarray) -> np.ndarray:
    """Colours of values from 0 (near white) to 1 (dark blue), shape (*values.shape, 3) uint8."""
    return _interpolate(np.clip(np.asarray(values, dtype=float), 0, 1), DIVERGING[3::-1])


def rgb(color: str) -> tuple[int, int, int]:
    """Red, green, blue of a colour written #RRGGBB."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def _interpolate(level: np.ndarray, stops: np.ndarray) -> np.ndarray:
    where = np.linspace(0, 1, len(stops))
    return (
        np.stack([np.interp(level, where, stops[:, i]) for i in range(3)], axis=-1).round().astype(np.uint8)
    )
