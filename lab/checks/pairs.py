"""Pairs of measured and modelled modes, by frequency, up to one common factor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.optimize

from identification.identify import identify
from identification.modes import Complex, Modes, mac
from identification.recording import Array, Recording
from lab.rig import Rig

NEAR = 0.2
"""Relative distance within which a mode at the written rate is the model's."""

TIGHT = 0.04
"""The same after a common factor, which must be one for all modes."""

BAND = 0.8
"""Share of half the sample rate up to which modes are compared."""

MAX_PAIRS = 7
COMPLEX = 0.3
"""Share of a measured shape's power out of phase, from which on it is no mode shape."""


@dataclass(frozen=True)
class Pairs:
    """Modes of the recording and of the model that belong together.

    Attributes:
        measured: real shapes, one column for each pair, shape (n_pairs, n_outputs) transposed: (n_outputs, n_pairs).
        modelled: likewise.
        frequency_hz: measured frequencies, shape (n_pairs,).
        ratio: median of measured over modelled frequency.
        scatter: relative spread of the ratios about it.
    """

    measured_shapes: Array
    modelled_shapes: Array
    measured: Array
    modelled: Array

    @property
    def ratio(self) -> float:
        """Median of measured over modelled frequency."""
        return float(np.median(self.measured / self.modelled))

    @property
    def scatter(self) -> float:
        """Largest distance of a ratio from the median, relative."""
        return float(np.max(np.abs(self.measured / self.modelled / self.ratio - 1)))


def pairs_of(recording: Recording, rig: Rig) -> Pairs | None:
    """Pairs of modes; None when the recording shows none of the model's.

    Args:
        recording: complete.
        rig: the model with the recording's channels connected, in their order.

    Raises:
        IdentificationError: the recording tells no modes.
    """
    found = identify(recording, uncertainty=False)
    measured = _credible(found.modes.take(np.array(found.stable, dtype=bool)), recording.sample_rate)
    modelled = rig.modes()
    seen = np.linalg.norm(modelled.shapes, axis=0) > 0
    modelled = modelled.take(seen & (modelled.damping_ratio < 0.7))
    if not len(measured) or not len(modelled):
        return None
    at_rate = _matched(measured, modelled, 1.0, NEAR)
    best, score = at_rate, _score(measured, modelled, at_rate)
    # Another rate must bring at least three modes together, and better than the written one does.
    if score < 0.9 * min(len(measured), len(modelled)):
        for ratio in np.unique(np.divide.outer(measured.frequency_hz, modelled.frequency_hz)):
            other = _matched(measured, modelled, float(ratio), TIGHT)
            value = _score(measured, modelled, other)
            if len(other) >= 3 and value > max(1.5 * score, 0.8 * len(other), 2.5):
                best, score = other, value
    if not best and len(measured) == 1 == len(modelled):
        best = [(0, 0)]
    if not best:
        return None
    rows, columns = np.array(best)[:MAX_PAIRS].T
    return Pairs(
        _real(measured.shapes[:, rows]),
        _real(modelled.shapes[:, columns]),
        measured.frequency_hz[rows],
        modelled.frequency_hz[columns],
    )


def _credible(modes: Modes, sample_rate: float) -> Modes:
    inside = modes.frequency_hz < BAND * sample_rate / 2
    damped = (modes.damping_ratio > 0) & (modes.damping_ratio < 0.3)
    shapes = modes.unit_length().shapes
    out_of_phase = 1 - np.sum(_real(shapes) ** 2, axis=0)
    return modes.take(inside & damped & (out_of_phase < COMPLEX))


def _real(shapes: Complex) -> Array:
    """Shapes turned to be as real as they can, of unit length but for what stays imaginary."""
    turned = shapes * np.exp(-0.5j * np.angle(np.sum(shapes**2, axis=0)))
    return np.asarray((turned / np.linalg.norm(shapes, axis=0)).real)


def _matched(measured: Modes, modelled: Modes, ratio: float, near: float) -> list[tuple[int, int]]:
    apart = np.abs(np.log(np.divide.outer(measured.frequency_hz, ratio * modelled.frequency_hz)))
    rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(apart, 2 * near))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if apart[i, j] < near]


def _score(measured: Modes, modelled: Modes, pairs: list[tuple[int, int]]) -> float:
    """Sum of the MAC over pairs, with the channels as they are named."""
    return float(sum(mac(measured.shapes[:, [i]], modelled.shapes[:, [j]])[0, 0] for i, j in pairs))
