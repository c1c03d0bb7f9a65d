"""Levels: how large a channel is, what is missing and what repeats, in one pass over the data."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array

Blocks = Callable[..., Iterator[Array]]

N_CELLS = 1024
"""Cells into which a record is averaged, to look at its slow motion."""

KEPT = 4096
"""Samples kept of each channel, to find its smallest step."""

MIN_RUN = 3
"""Equal samples in a row that are worth remembering."""


@dataclass(frozen=True)
class Levels:
    """Sizes of the channels of one record; arrays of shape (n_channels,) unless told otherwise.

    Attributes:
        n_samples: of the record.
        lowest: smallest sample that is there.
        highest: largest sample that is there.
        mean: of the samples that are there.
        rms: about the mean.
        n_missing: samples that are not finite numbers.
        first_missing: where they begin; -1 for none.
        last_missing: where they end.
        n_repeated: samples equal to the one before.
        step: distance of which all differences are multiples; 0 when there is none.
        n_values: distinct values among the samples kept to find the step.
        cells: averages over consecutive cells, NaN where nothing is left, shape (n_channels, n_cells).
        runs: rows (first sample, length) of three equal samples or more, one array for each channel.
    """

    n_samples: int
    lowest: Array
    highest: Array
    mean: Array
    rms: Array
    n_missing: NDArray[np.int64]
    first_missing: NDArray[np.int64]
    last_missing: NDArray[np.int64]
    n_repeated: NDArray[np.int64]
    step: Array
    n_values: NDArray[np.int64]
    cells: Array
    runs: tuple[NDArray[np.int64], ...]


def levels_of(blocks: Blocks, n_samples: int, n_channels: int) -> Levels:
    """Levels of a record that is read block by block."""
    size = -(-n_samples // N_CELLS)
    lowest, highest = np.full(n_channels, np.inf), np.full(n_channels, -np.inf)
    n_missing, first, last = (np.zeros(n_channels, np.int64) for _ in range(3))
    first -= 1
    n_repeated = np.zeros(n_channels, np.int64)
    squares, cells, counts = np.zeros(n_channels), [], []
    shift: Array | None = None
    runs: list[list[NDArray[np.int64]]] = [[] for _ in range(n_channels)]
    sample = [[] for _ in range(n_channels)]  # type: list[list[Array]]
    before, at = np.full((n_channels, 1), np.nan), 0
    stride = max(n_samples // KEPT, 1)
    for x in blocks(multiple=size):
        there = np.isfinite(x)
        complete = bool(there.all())
        if not complete:
            missing = ~there
            n_missing += missing.sum(axis=1)
            for row in np.flatnonzero(missing.any(axis=1)).tolist():
                where = np.flatnonzero(missing[row])
                first[row] = int(at + where[0]) if first[row] < 0 else int(first[row])
                last[row] = int(at + where[-1])
        clean = x if complete else np.where(there, x, np.nan)
        if n_channels and x.shape[1]:
            lowest = np.minimum(lowest, np.min(x, axis=1, where=there, initial=np.inf))
            highest = np.maximum(highest, np.max(x, axis=1, where=there, initial=-np.inf))
        # About the first value, so that an offset takes no digits from the spread.
        shift = _first(clean) if shift is None else np.where(np.isfinite(shift), shift, _first(clean))
        moved = np.where(there, x - np.nan_to_num(shift)[:, None], 0.0)
        edges = np.arange(0, x.shape[1], size)
        cells.append(np.add.reduceat(moved, edges, axis=1))
        counts.append(np.add.reduceat(there, edges, axis=1, dtype=np.int64))
        squares += np.einsum("ij,ij->i", moved, moved)
        joined = np.concatenate([before, x], axis=1)
        same = joined[:, 1:] == joined[:, :-1]
        repeats = same.sum(axis=1)
        n_repeated += repeats
        for row in range(n_channels):
            if repeats[row]:
                runs[row].append(_runs(same[row], at))
            sample[row].append(x[row, ::stride])
        before, at = x[:, -1:], at + x.shape[1]
    total, count = np.concatenate(cells, axis=1), np.concatenate(counts, axis=1)
    there_are = np.maximum(count.sum(axis=1), 1)
    offset = total.sum(axis=1) / there_are
    base = np.zeros(n_channels) if shift is None else np.nan_to_num(shift)
    with np.errstate(invalid="ignore"):
        averages = np.where(count > 0, total / np.maximum(count, 1), np.nan) + base[:, None]
    steps = [_step(np.concatenate(kept)) for kept in sample]
    return Levels(
        n_samples,
        lowest,
        highest,
        base + offset,
        np.sqrt(np.maximum(squares / there_are - offset**2, 0.0)),
        n_missing,
        first,
        last,
        n_repeated,
        np.array([step for step, _ in steps]),
        np.array([n for _, n in steps], dtype=np.int64),
        averages,
        tuple(_joined(found) for found in runs),
    )


def _first(x: Array) -> Array:
    """The first finite value of each row, NaN for none."""
    there = np.isfinite(x)
    return np.where(there.any(axis=1), x[np.arange(len(x)), np.argmax(there, axis=1)], np.nan)


def _runs(same: NDArray[np.bool_], at: int) -> NDArray[np.int64]:
    """Rows (first sample, length) of the runs of equal samples in a block that starts at sample `at`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    return np.stack([at + starts - 1, stops - starts + 1], axis=1)


def _joined(found: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    """All runs of a channel, those cut by the end of a block made whole, the short ones left out."""
    if not found:
        return np.zeros((0, 2), np.int64)
    runs = np.concatenate(found)
    ends = runs[:, 0] + runs[:, 1] - 1
    starts = np.concatenate([[True], runs[1:, 0] != ends[:-1]])
    group = np.cumsum(starts) - 1
    first = runs[starts, 0]
    last = np.zeros(first.size, np.int64)
    np.maximum.at(last, group, ends)
    whole = np.stack([first, last - first + 1], axis=1)
    return whole[whole[:, 1] >= MIN_RUN]


def _step(x: Array) -> tuple[float, int]:
    """The distance of which all differences are whole multiples, or 0, and the number of distinct values."""
    values = np.unique(x[np.isfinite(x)])
    if values.size < 2:
        return 0.0, int(values.size)
    gaps = np.diff(values)
    # Values printed in decimal may differ in their last digit and be the same level.
    gaps = gaps[gaps > 1e-9 * (values[-1] - values[0])]
    least = float(np.min(gaps))
    step = float(np.mean(gaps[gaps < 1.5 * least]))
    multiples = np.round(gaps / step)
    step = float(np.sum(gaps) / np.sum(multiples))
    # Differences of continuous values lie so near to whole multiples one time in ten.
    whole = np.abs(gaps / step - multiples) < 0.05
    n_values = int(gaps.size + 1)
    return (step, n_values) if np.all(whole) else (0.0, n_values)
