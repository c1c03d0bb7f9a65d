"""Outliers: samples that the past of their own channel does not foretell, and what kind of surprise they are.

A channel is foretold by an autoregression, x_k = Σ c_i x_{k-i} + e_k, with π = (1, -c_1, …, -c_p). What a disturbance
of size a at sample k leaves in the residual e tells its kind:

    a single wrong sample (additive)      e_{k+j} = a π_j
    a lasting step of the level           e_{k+j} = a (π_0 + … + π_j)
    a real event (innovational)           e_k = a alone: afterwards the structure answers as it always does

The kind of the largest likelihood ratio wins: a blow is of the last kind and no spike.

Source: Fox (1972), J. R. Stat. Soc. B 34, 350-363; Chang, Tiao and Chen (1988), Technometrics 30, 193-204, eq. (2.5).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.signal

from identification.recording import Array
from lab.checks.levels import Blocks, Levels

ORDER = 16
SURPRISE = 5.0
"""Residual, over its local scale, from which on a sample is looked at."""

STRETCH = 256
"""Samples over which the scale of the residual is taken."""

REACH = 64
"""Residuals that the level before and after an event is told from."""

MAX_EVENTS = 500
"""Events told apart in one block of one channel; more of them are not surprises."""


MIN_LEVELS = 8
"""Fewer values than these lie on multiples of a step by chance."""


@dataclass(frozen=True)
class Outlier:
    """One surprise.

    Attributes:
        sample: where it begins.
        kind: "spike", "jump" or "event".
        size: of the spike or jump [unit of the channel].
        ratio: likelihood ratio of its kind, in standard deviations.
        lead: squared ratio less that of the best other kind.
    """

    sample: int
    kind: str
    size: float
    ratio: float
    lead: float


def outliers_of(blocks: Blocks, levels: Levels) -> list[tuple[Outlier, ...]]:
    """Outliers of every channel, in the order in which they were found."""
    n_channels = levels.rms.size
    models: list[Array | None] = [None] * n_channels
    found: list[list[Outlier]] = [[] for _ in range(n_channels)]
    tail, at = np.zeros((n_channels, 0)), 0
    for x in blocks():
        # The end of the last block comes again, since the residual needs a past and a future.
        line = np.concatenate([tail, x], axis=1)
        start = at - tail.shape[1]
        for row in range(n_channels):
            if levels.rms[row] > 0:
                y = _filled(line[row] - levels.mean[row])
                if models[row] is None:
                    models[row] = autoregression(y)
                new = _in_block(y, models[row], start, at == 0, levels, row)
                gone = ~np.isfinite(line[row])
                # What stands in for a missing sample is no surprise.
                found[row] += [
                    o for o in new if not gone[max(o.sample - start - 2, 0) : o.sample - start + 2].any()
                ]
        tail = line[:, -(REACH + ORDER) :] if line.shape[1] > REACH + ORDER else line
        at += x.shape[1]
    return [tuple(_once(each)) for each in found]


def _once(found: list[Outlier]) -> Iterator[Outlier]:
    """Each surprise once, though two blocks may see it."""
    seen: set[int] = set()
    for each in found:
        if not any(each.sample + k in seen for k in (-1, 0, 1)):
            seen.add(each.sample)
            yield each


def _filled(x: Array) -> Array:
    """Missing samples replaced by the last one there."""
    there = np.isfinite(x)
    if there.all():
        return x
    last = np.maximum.accumulate(np.where(there, np.arange(x.size), -1))
    return np.asarray(np.where(last >= 0, x[np.maximum(last, 0)], 0.0))


def autoregression(y: Array, order: int = ORDER) -> Array | None:
    """π of the channel, from up to 2^16 of its samples; None for too short a record."""
    n = y.size
    order = min(order, n // 20)
    if order < 1:
        return None
    y = y[: 1 << 16].copy()
    pi = np.ones(1)
    for _ in range(3):
        n_fft = 1 << (2 * y.size - 1).bit_length()
        r = np.fft.irfft(np.abs(np.fft.rfft(y, n_fft)) ** 2)[: order + 1]
        if not r[0] > 0:
            break  # nothing but wild samples, such as a single blow
        # Rounding of the correlations is the least noise that an autoregression can know of.
        r[0] *= 1 + 1e-9
        pi = np.concatenate([[1.0], -scipy.linalg.solve_toeplitz(r[:-1], r[1:])])
        # Wild samples would teach their own model: they are drawn in before the next fit.
        e = scipy.signal.lfilter(pi, [1.0], y)
        limit = 4 * np.maximum(_scale(e), 1e-12 * np.sqrt(r[0] / y.size))
        wild = np.abs(e) > limit
        wild[:order] = False
        if not wild.any():
            break
        y[wild] -= (e - np.clip(e, -limit, limit))[wild]
    return pi


def _scale(e: Array) -> Array:
    """Standard deviation of the residual around each sample: the largest of its own stretch and its neighbours'."""
    n = max(e.size // STRETCH, 1)
    width = e.size // n
    cells = np.abs(e[: n * width]).reshape(n, width)
    # The tenth largest in a hundred: few wild samples do not reach it, nor does a structure at rest half of the time.
    cells = cells[:, :: 4 if width >= 64 else 1]
    tenth = cells.shape[1] // 10
    scale = np.partition(cells, -1 - tenth, axis=1)[:, -1 - tenth] / 1.645
    ringed = np.concatenate([scale[:1], scale, scale[-1:]])
    largest = np.maximum(np.maximum(ringed[:-2], ringed[1:-1]), ringed[2:])
    return np.asarray(np.repeat(largest, width)[np.minimum(np.arange(e.size), n * width - 1)])


def _in_block(
    y: Array, pi: Array | None, start: int, first: bool, levels: Levels, row: int
) -> Iterator[Outlier]:
    """Outliers of one block, the largest first, each taken out before the next is looked for."""
    if pi is None or y.size <= 2 * pi.size:
        return
    e = scipy.signal.lfilter(pi, [1.0], y)
    known = pi.size - 1
    e[:known] = 0.0
    # Rounding to steps leaves a residual of this size, even where the channel stands still.
    step = levels.step[row] if levels.n_values[row] >= MIN_LEVELS else 0.0
    floor = max(step * np.linalg.norm(pi) / np.sqrt(12), 1e-7 * levels.rms[row])
    s = np.maximum(_scale(e), floor)
    wild = np.flatnonzero(np.abs(e) > SURPRISE * s)
    if wild.size > MAX_EVENTS:
        wild = wild[np.argsort(-np.abs(e[wild] / s[wild]), kind="stable")[:MAX_EVENTS]]
    left = set(wild.tolist())
    while left:
        top = max(left, key=lambda k: abs(e[k]) / s[k])
        if abs(e[top]) <= SURPRISE * s[top]:
            return
        outlier, effect = _told(e, s, pi, top)
        k = outlier.sample
        n = min(effect.size, e.size - k)
        e[k : k + n] -= effect[:n]
        left -= set(range(top - 1, top + 2)) | {k}
        if k >= known or not first:
            yield Outlier(start + k, outlier.kind, outlier.size, outlier.ratio, outlier.lead)


def _told(e: Array, s: Array, pi: Array, top: int) -> tuple[Outlier, Array]:
    """The kind of the surprise whose largest residual is at `top`, and what it leaves in the residual."""
    steps = np.concatenate([np.cumsum(pi), np.full(REACH - pi.size, np.sum(pi))])
    best: list[tuple[float, int, float, str, Array]] = []
    for kind, shape in (("spike", pi), ("jump", steps), ("event", np.ones(1))):
        back = {"spike": pi.size - 1, "jump": 1, "event": 0}[kind]
        reach = range(max(top - back, 0), top + 1)
        fits = []
        for k in reach:
            n = min(shape.size, e.size - k)
            weight = shape[:n] / s[k] ** 2
            information = float(weight @ shape[:n])
            size = float(weight @ e[k : k + n]) / information
            fits.append((size * size * information, k, size, kind, size * shape))
        best.append(max(fits, key=lambda fit: fit[0]))
    best.sort(key=lambda fit: -fit[0])
    ratio, k, size, kind, effect = best[0]
    return Outlier(k, kind, size, float(np.sqrt(ratio)), ratio - best[1][0]), effect
