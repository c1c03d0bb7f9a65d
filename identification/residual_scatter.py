"""How far the noise of the sensors moves any estimate from measured inputs: by drawing it anew.

What a model leaves of the outputs is noise that was there. A copy in which every spectral line is another one nearby,
with a phase of its own, is noise that might have been there: of the same spectrum, equally shared by the outputs. Added
to what the model makes of the inputs, it gives a test that might have been, and its estimate.

A line must not stand for itself: at the few lines of a resonance the fit has absorbed most of the noise, and it is those
lines that poles and matrices hang on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.fft

from identification.errors import TooShortError
from identification.progress import UNHEARD, Work
from identification.recording import Array, Recording

DRAWS = 24
"""Tests drawn; a standard deviation from them is good to 1/√(2 · 23) = 15 %."""

NEARBY = 0.05
"""Share of all lines, on either side, among which each one is redrawn: wide against a resonance."""

MAY_FAIL = 0.1
"""Share of the tests drawn that may fail to give an estimate."""


class ErrorBars(NamedTuple):
    """What redrawn noise does to an estimate.

    Attributes:
        std: one standard deviation, from the truth where that is known, shape (n_values,); infinite where more than a
            share `MAY_FAIL` of the tests do not give the estimate.
        shift: what noise adds to it on average, shape (n_values,); NaN where the truth is not known.
    """

    std: Array
    shift: Array


def residual_scatter(
    recording: Recording,
    residuals: Sequence[Array],
    estimate: Callable[[Recording], Array],
    *,
    n_unknowns: int = 0,
    truth: Array | None = None,
    rng: np.random.Generator | None = None,
    work: Work = UNHEARD,
) -> ErrorBars:
    """One standard deviation of an estimate and its mean error, from tests with the noise of the outputs drawn anew.

    Where the truth of these tests is told, deviations count from it: what noise makes too large on average is part of
    the error.

    Args:
        recording: with measured inputs.
        residuals: what a model leaves of the outputs of each record, shape (n_outputs, n_samples).
        estimate: what is wanted from a recording, shape (n_values,); NaN where it cannot be had.
        n_unknowns: numbers that were fitted to make the residuals small, which is given back to them.
        truth: what the estimate should be for the model without noise, shape (n_values,); NaN where that is not known.
        rng: source of the phases; the same ones for every call when None, so that a result can be repeated.
        work: told of every test drawn.

    Returns:
        Both.

    Raises:
        TooShortError: no more samples than unknowns.

    Source: Efron and Tibshirani (1993), An Introduction to the Bootstrap, eq. (6.6) and algorithm 9.1, residuals
        of a regression; their lines redrawn as in Paparoditis and Politis (1999), J. Time Ser. Anal. 20(2), 193-222,
        the local bootstrap, with phases as in Theiler et al. (1992), Physica D 58, 77-94, eq. (8).
    """
    rng = np.random.default_rng(0) if rng is None else rng
    n_values = sum(e.size for e in residuals)
    if n_values <= n_unknowns:
        raise TooShortError(
            f"{n_values} samples tell nothing of the noise beyond {n_unknowns} unknowns; record for longer"
        )
    scale = 1 / np.sqrt(1 - n_unknowns / n_values)  # what the fit has absorbed is given back
    clean = [
        np.asarray(record.outputs[:, :], dtype=float) - e
        for record, e in zip(recording.records, residuals, strict=True)
    ]
    draws = []
    for _ in work.each(range(DRAWS)):
        records = tuple(
            replace(record, outputs=y + scale * redrawn(e, rng))
            for record, y, e in zip(recording.records, clean, residuals, strict=True)
        )
        draws.append(estimate(replace(recording, records=records)))
    return scatter_of(np.array(draws), truth)


def scatter_of(values: Array, truth: Array | None = None) -> ErrorBars:
    """One standard deviation of estimates from tests that were drawn, about their truth or else their mean, and their shift.

    Args:
        values: shape (n_draws, n_values); NaN where an estimate could not be had.
        truth: shape (n_values,); NaN where it is not known.

    Returns:
        Both.

    Source: Efron and Tibshirani (1993), An Introduction to the Bootstrap, eq. (6.6), and (10.1) for the shift.
    """
    have = np.isfinite(values)
    n = np.maximum(np.sum(have, axis=0), 2)
    mean = np.sum(values, axis=0, where=have) / n
    truth = np.full(mean.shape, np.nan) if truth is None else truth
    known = np.isfinite(truth)
    variance = np.sum((values - np.where(known, truth, mean)) ** 2, axis=0, where=have) / (n - 1 + known)
    enough = np.mean(have, axis=0) >= 1 - MAY_FAIL
    return ErrorBars(np.where(enough, np.sqrt(variance), np.inf), np.where(enough, mean - truth, np.nan))


def redrawn(e: Array, rng: np.random.Generator) -> Array:
    """Noise that might have been in place of the noise e: lines of nearby frequencies with phases drawn anew.

    Args:
        e: noise of all outputs, shape (n_outputs, n_samples).
        rng: source of lines and phases, the same ones for all outputs, which keeps their cross-spectra.

    Returns:
        Shape (n_outputs, n_samples).

    Source: Paparoditis and Politis (1999), J. Time Ser. Anal. 20(2), 193-222, the local bootstrap; Prichard and Theiler
        (1994), Phys. Rev. Lett. 73(7), eq. (3), the phases.
    """
    E = scipy.fft.rfft(e)
    n = E.shape[1]
    reach = int(np.ceil(NEARBY * n))
    lines = np.abs(np.arange(n) + rng.integers(-reach, reach + 1, n))
    E = E[:, np.where(lines < n, lines, 2 * (n - 1) - lines)]  # mirrored at both ends
    phase = np.exp(2j * np.pi * rng.random(n))
    redrawn = E * phase
    # Zero and half the sample rate have no phase; a turned line has half its power in its real part.
    real = [0, -1] if e.shape[1] % 2 == 0 else [0]
    redrawn[:, real] = np.sqrt(2) * redrawn[:, real].real
    return np.asarray(scipy.fft.irfft(redrawn, e.shape[1]))
