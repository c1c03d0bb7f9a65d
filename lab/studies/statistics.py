"""What many runs say together, point by point: shares, coverage of error bars, RMS errors, means, with their intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import h5py
import numpy as np

from identification.recording import Array
from lab.studies.table import blocks

NOMINAL = 0.9545
"""Share of normal errors below two standard deviations."""
Quantities = Callable[[h5py.File], Iterator[tuple[Array, Array]]]
"""Points (n,) and one number per run (n,), NaN where a run has none, block by block."""


@dataclass(frozen=True, eq=False)
class Statistic:
    """A number per point with its interval of about 95 %, from the scatter of the runs; shape (n_points,) each.

    Attributes:
        name: share, coverage, RMS or mean of what.
        kind: "share" (of runs, or of true modes), "coverage" (mean share of error bars that hold), "rms" or "mean".
        value, low, high: NaN where no run has the number; the ends also where a single run has one.
        n: number of runs that have it.
    """

    name: str
    kind: str
    value: Array
    low: Array
    high: Array
    n: Array


def statistics(file: h5py.File) -> list[Statistic]:
    """All statistics that the columns of a study allow; `file` is its study.h5."""
    n_points = int(file["runs/point"][:].max()) + 1
    found = [_statistic(file, n_points, name, kind, take) for name, kind, take in _wanted(file)]
    return [each for each in found if each.n.any()]


def share_interval(share: Array, n: Array) -> tuple[Array, Array]:
    """Where the probability behind a share of n trials lies, to 95.45 % (two standard deviations).

    Source: Wilson (1927), J. Am. Stat. Assoc. 22, pp. 209-212.
    """
    z2 = 4.0
    with np.errstate(invalid="ignore", divide="ignore"):
        middle = (share + z2 / (2 * n)) / (1 + z2 / n)
        half = np.sqrt(z2 * (share * (1 - share) / n + z2 / (4 * n**2))) / (1 + z2 / n)
    return np.clip(middle - half, 0, 1), np.clip(middle + half, 0, 1)


def _wanted(file: h5py.File) -> Iterator[tuple[str, str, Quantities]]:
    there = file["runs"]

    def one(name: str) -> Quantities:
        return partial(_each, name=name, reduce=_mean)

    def squares(name: str) -> Quantities:
        return partial(_each, name=name, reduce=lambda x: _mean(x**2))

    for name in ("named_rightly", "verdict_right", "criteria_met"):
        if name in there:
            yield name, "share", one(name)
    if "modes_found" in there:
        yield "modes_found", "share", one("modes_found")
    for name in ("frequency", "damping"):
        if f"{name}_std" in there:
            yield f"{name}_covered", "coverage", partial(_covered, name=name)
    if "parameter_deviation" in there:
        held = partial(_each, name="parameter_deviation", reduce=lambda x: _mean(_below(np.abs(x), 2.0)))
        yield "parameter_covered", "coverage", held
    for name in ("mass", "damping_matrix", "stiffness"):
        if f"{name}_covered" in there:
            yield f"{name}_covered", "coverage", one(f"{name}_covered")
    for name in ("frequency", "damping", "mass", "damping_matrix", "stiffness", "parameter"):
        if f"{name}_error" in there:
            yield f"{name}_error", "rms", squares(f"{name}_error")
    yield "seconds", "mean", one("seconds")
    for name in there.get("collected", {}):
        if there["collected"][name].dtype != object:
            yield f"collected/{name}", "mean", one(f"collected/{name}")


def _statistic(file: h5py.File, n_points: int, name: str, kind: str, take: Quantities) -> Statistic:
    n, mean, variance = _moments(lambda: take(file), n_points)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Of a mean of n numbers; one number tells nothing of its scatter.
        error = np.sqrt(variance / n)
    if kind in ("share", "coverage"):
        # The error bars of one run err together, so that a run counts once.
        low, high = share_interval(mean, n)
    else:
        low, high = mean - 2 * error, mean + 2 * error
    if kind == "rms":
        mean, low, high = np.sqrt(mean), np.sqrt(np.maximum(low, 0)), np.sqrt(high)
    return Statistic(name, kind, mean, low, high, n.astype(int))


def _moments(take: Callable[[], Iterator[tuple[Array, Array]]], n_points: int) -> tuple[Array, Array, Array]:
    """Count, mean and variance per point, in two passes, which keeps their digits."""
    n, total, squares = np.zeros(n_points), np.zeros(n_points), np.zeros(n_points)
    for point, x in take():
        has = np.isfinite(x)
        n += np.bincount(point[has], minlength=n_points)
        total += np.bincount(point[has], x[has], n_points)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / n
    for point, x in take():
        has = np.isfinite(x)
        squares += np.bincount(point[has], (x[has] - mean[point[has]]) ** 2, n_points)
    with np.errstate(invalid="ignore", divide="ignore"):
        return n, mean, np.where(n > 1, squares / (n - 1), np.nan)


def _each(file: h5py.File, name: str, reduce: Callable[[Array], Array]) -> Iterator[tuple[Array, Array]]:
    for point, values in blocks(file, name):
        yield point, reduce(values)


def _covered(file: h5py.File, name: str) -> Iterator[tuple[Array, Array]]:
    """Share of the modes of a run whose error is below two standard deviations."""
    errors, stds = blocks(file, f"{name}_error"), blocks(file, f"{name}_std")
    for (point, error), (_, std) in zip(errors, stds, strict=True):
        with np.errstate(invalid="ignore"):
            inside = np.where(np.isfinite(error) & np.isfinite(std), np.abs(error) < 2 * std, np.nan)
        yield point, _mean(inside)


def _below(x: Array, limit: float) -> Array:
    return np.where(np.isfinite(x), x < limit, np.nan)


def _mean(x: Array) -> Array:
    """Mean of each row over what it has."""
    has = np.isfinite(x)
    n = has.sum(axis=1)
    total = np.where(has, x, 0.0).sum(axis=1)
    return np.divide(total, n, out=np.full(len(x), np.nan), where=n > 0)
