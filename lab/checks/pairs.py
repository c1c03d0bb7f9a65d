"""Pairs of measured and modelled modes, by frequency, up to one common factor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.optimize

from identification.identify import identify
from identification.modes import Complex, Modes
from identification.recording import Array, Recording
from lab.checks.arrangement import balanced, best_arrangement, macs
from lab.rig import Rig

Matching = list[tuple[int, int]]
"""Positions of modes that belong together: measured, modelled."""

NEAR = 0.4
"""Logarithm of the ratio of frequencies within which a mode at the written rate can be the model's."""

TIGHT = 0.04
"""The same after a common factor, which must be one for all modes."""

ALIKE = 0.6
"""MAC from which on a pair speaks for its shapes, below which against them."""

STRETCHED = 0.2
"""What a pair loses for each unit of the logarithm of its ratio of frequencies."""

LEFT_OUT = 0.2
"""What is lost for a mode of the model left out below the highest pair; half of it for a measured one."""

CHANGE = 0.03
"""What is lost for each channel in another place or with another sign."""

WORTH = 0.3
"""Gain of agreement for which channels may have changed places."""

FREE = 2
"""Pairs from which on channels may change places; one more, and each may have a factor."""

BAND = 0.8
"""Share of half the sample rate up to which modes are compared."""

MAX_MODES = 8
MAX_PAIRS = 5
MAX_CHOICES = 1000
FITS = 0.85
"""Mean MAC at which shapes agree, although the model is only nominal."""

COMPLEX = 0.3
"""Share of a measured shape's power out of phase, from which on it is no mode shape."""


@dataclass(frozen=True)
class Pairs:
    """Modes of the recording and of the model that belong together.

    Attributes:
        measured_shapes: real, of unit length but for what is out of phase, shape (n_outputs, n_pairs).
        modelled_shapes: likewise.
        measured: measured frequencies [Hz], shape (n_pairs,).
        modelled: frequencies of the model [Hz], likewise.
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

    Outputs alone tell the modes here, since an input may be what is wrong.

    Args:
        recording: complete.
        rig: the model with the recording's channels connected, in their order.

    Raises:
        IdentificationError: the recording tells no modes.
    """
    found = identify(recording.select(inputs=[]), "ssi_cov", uncertainty=False)
    measured = _credible(found.modes.take(np.array(found.stable, dtype=bool)), recording.sample_rate)
    modelled = rig.modes()
    seen = np.linalg.norm(modelled.shapes, axis=0) > 0
    modelled = modelled.take(seen & (modelled.damping_ratio < 0.7))
    if not len(measured) or not len(modelled):
        return None
    measured, modelled = (modes.take(np.arange(min(len(modes), MAX_MODES))) for modes in (measured, modelled))
    phi, psi = _real(measured.shapes), _real(modelled.shapes)
    named, named_score = _as_named(measured, modelled, phi, psi)
    free, free_score = _in_any_order(measured, modelled, phi, psi)
    best = free if free_score > named_score + WORTH else named
    if not best or _agreement(named, phi, psi) < FITS:
        best = _at_another_rate(measured, modelled, phi, psi) or best
    if not best and len(measured) == 1 == len(modelled):
        best = [(0, 0)]
    if not best:
        return None
    rows, columns = np.array(best)[:MAX_PAIRS].T
    return Pairs(phi[:, rows], psi[:, columns], measured.frequency_hz[rows], modelled.frequency_hz[columns])


def _as_named(measured: Modes, modelled: Modes, phi: Array, psi: Array) -> tuple[Matching, float]:
    """The rising pairs that agree best with the channels as they are named, and how well."""
    best: Matching = []
    highest = 0.0
    for pairs in _rising(measured, modelled):
        score = float(np.sum(_values(pairs, phi, psi) - ALIKE)) - _stretch(pairs, measured, modelled)
        if score > highest:
            best, highest = pairs, score
    return best, highest


def _in_any_order(measured: Modes, modelled: Modes, phi: Array, psi: Array) -> tuple[Matching, float]:
    """The same when channels may change places, signs and factors."""
    best: Matching = []
    highest = 0.0
    choices = [pairs for pairs in _rising(measured, modelled) if len(pairs) >= FREE]
    promised = [len(pairs) * (1 - ALIKE) - _stretch(pairs, measured, modelled) for pairs in choices]
    for k in np.argsort(-np.array(promised), kind="stable"):
        if promised[k] <= highest:
            break  # the rest cannot agree better
        pairs = choices[k]
        rows, columns = np.array(pairs).T
        shapes = [(phi[:, rows], psi[:, columns])]
        if len(pairs) > FREE:
            shapes.append((balanced(phi[:, rows]), balanced(psi[:, columns])))
        for a, b in shapes:
            found = best_arrangement(a, b)
            score = float(np.sum(macs(found.arranged(a), b) - ALIKE)) - CHANGE * found.n_changes
            score -= _stretch(pairs, measured, modelled)
            if score > highest:
                best, highest = pairs, score
    return best, highest


def _at_another_rate(measured: Modes, modelled: Modes, phi: Array, psi: Array) -> Matching:
    """Three pairs or more whose frequencies have one ratio, and whose shapes agree as named; none when there are none."""
    best: Matching = []
    for ratio in np.unique(np.divide.outer(measured.frequency_hz, modelled.frequency_hz)):
        pairs = _matched(measured, modelled, float(ratio), TIGHT)
        if len(pairs) > max(len(best), 2) and _agreement(pairs, phi, psi) > FITS:
            best = pairs
    return best


def _rising(measured: Modes, modelled: Modes) -> list[Matching]:
    """All choices of pairs that rise together in both sets, each within `NEAR`, up to `MAX_PAIRS` of them."""
    apart = np.abs(np.log(np.divide.outer(measured.frequency_hz, modelled.frequency_hz)))
    near = [(int(i), int(j)) for i, j in np.argwhere(apart < NEAR)]
    found: list[Matching] = []

    def grow(pairs: Matching, rest: Matching) -> None:
        if pairs:
            found.append(pairs)
        if len(pairs) < MAX_PAIRS and len(found) < MAX_CHOICES:
            for i, j in rest:
                grow([*pairs, (i, j)], [(k, m) for k, m in rest if k > i and m > j])

    grow([], near)
    return found


def _stretch(pairs: Matching, measured: Modes, modelled: Modes) -> float:
    """What pairs lose for frequencies that lie apart and for modes left out between and below them."""
    rows, columns = np.array(pairs).T
    left_out = LEFT_OUT * float(columns[-1] + 1 - len(pairs)) + LEFT_OUT / 2 * float(
        rows[-1] + 1 - len(pairs)
    )
    return left_out + STRETCHED * float(
        np.sum(np.abs(np.log(measured.frequency_hz[rows] / modelled.frequency_hz[columns])))
    )


def _agreement(pairs: Matching, phi: Array, psi: Array) -> float:
    """Mean MAC with the channels as they are named; 0 without pairs."""
    return float(np.mean(_values(pairs, phi, psi))) if pairs else 0.0


def _values(pairs: Matching, phi: Array, psi: Array) -> Array:
    """MAC of each pair with the channels as they are named."""
    rows, columns = np.array(pairs).T
    return macs(phi[:, rows], psi[:, columns])


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


def _matched(measured: Modes, modelled: Modes, ratio: float, near: float) -> Matching:
    apart = np.abs(np.log(np.divide.outer(measured.frequency_hz, ratio * modelled.frequency_hz)))
    rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(apart, 2 * near))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if apart[i, j] < near]
