"""Whiteness: whether a residual is noise, or something is left in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.special

from identification.recording import Array

LAGS = 40
LEVEL = 1e-3
"""Probability that white noise fails the test."""
MATTERS = 0.05
"""Share of a residual's power that must be predictable for it to count: in a long record any two simulators differ
significantly, and what is below a twentieth of the noise nobody would miss in a prediction."""

POWERS = 2, 3
"""Of the signal, that a residual is held against."""
PATCHED = 0.5
"""Share of what was left that a cause must take to be more than a patch."""


@dataclass(frozen=True)
class Whiteness:
    """Largest correlation of a residual with its own past, the inputs and powers of the signal, in standard deviations.

    Attributes:
        largest: of all correlations tested.
        limit: that white noise stays below, but for a probability of `LEVEL`.
        channel: output with the largest correlation.
        lag: in samples.
        with_input: number of the input it correlates with; None for its own past or signal.
        share: of the residual's power that past, inputs and signal predict, in the channel where that is most.
        left: information in what they predict, twice, over all channels [nat per sample].
        level: logarithm of the residual's mean square, summed over all channels.
    """

    largest: float
    limit: float
    channel: int
    lag: int
    with_input: int | None
    share: float
    left: float
    level: float
    of_signal: int = 0
    """Power of the channel's own signal that it correlates with; 0 for another."""

    @property
    def white(self) -> bool:
        """Whether the residual passes for white noise."""
        return self.largest <= self.limit

    @property
    def passed(self) -> bool:
        """Whether the residual passes for noise, or for so little more that nobody would miss it."""
        return self.white or self.share <= MATTERS


def patches(before: Whiteness, after: Whiteness) -> bool:
    """Whether a cause only patches what it does not explain: most of what was left is left with it, too.

    A law that only resembles the one that was named leaves a little behind, of which any other cause takes a part; what causes
    a residual takes nearly all of it. What takes more than all that was known to be left is no patch, whatever shows behind it.
    """
    taken = before.level - after.level
    return bool(
        not (before.white or after.white) and after.left > PATCHED * before.left and taken < before.left
    )


def whiteness(
    residual: Array, inputs: Array, signals: Array | None = None, *, missing: np.ndarray | None = None
) -> Whiteness:
    """Test of a residual (n_outputs, n) against its own past, the inputs (n_inputs, n) and powers of the signals.

    Under white noise every correlation is Gaussian with variance 1 / n; the limit is that of the largest of all of them
    (Ljung 1999, System Identification, 16.6; Bonferroni). Signals (n_outputs, n) are the model's, in which noise has no part:
    what is left of a clipped or bent one shows in its second and third power, once nothing is left for a straight line. Where
    samples are `missing` (n_outputs, n), the residual is zero and fewer pairs tell of its past.
    """
    n = residual.shape[1]
    known = np.ones(residual.shape, dtype=bool) if missing is None else ~missing
    if not np.all(known):
        # So few samples tell nothing of what they have in common.
        known = known & (np.sum(known, axis=1, keepdims=True) > LAGS * (2 + len(inputs)))
    e = _normalized(residual, known)
    # In standard deviations, (n_lags, n_outputs).
    own = np.stack(
        [
            np.sum(e[:, k:] * e[:, : n - k], axis=1) * _scale(known[:, k:] & known[:, : n - k], known)
            for k in range(1, LAGS + 1)
        ]
    )
    driven = inputs[np.std(inputs, axis=1) > 0] if inputs.size else np.zeros((0, n))
    u = _normalized(driven)
    cross = np.array([[e[:, k:] @ row[: n - k] for k in range(LAGS)] for row in u]).reshape(
        len(u), LAGS, len(e)
    )
    curves = (
        np.zeros((len(e), 0, n))
        if signals is None
        else np.array([_curves(signal) for signal in np.nan_to_num(signals)])
    )
    bends = np.einsum("ipk,ik->ip", curves, e)
    tests = own.size + cross.size + bends.size
    limit = -float(scipy.special.ndtri(LEVEL / (2 * max(tests, 1))))
    k, i = np.unravel_index(np.argmax(np.abs(own)), own.shape)
    shares = _predictable(e, u, curves, known)
    told = (
        float(np.max(shares)),
        float(-np.sum(np.log1p(-np.clip(shares, 0.0, 1 - 1e-12)))),
        float(np.sum(np.log(np.maximum(np.mean(residual**2, axis=1), 1e-300)))),
    )
    best = Whiteness(float(np.abs(own[k, i])), limit, int(i), int(k) + 1, None, *told)
    if cross.size:
        j, k, i = np.unravel_index(np.argmax(np.abs(cross)), cross.shape)
        size = float(np.sqrt(n) * np.abs(cross[j, k, i]))
        if size > best.largest:
            best = Whiteness(size, limit, int(i), int(k), int(j), *told)
    if bends.size:
        i, power = np.unravel_index(np.argmax(np.abs(bends)), bends.shape)
        size = float(np.sqrt(n) * np.abs(bends[i, power]))
        if size > best.largest:
            best = Whiteness(size, limit, int(i), 0, None, *told, of_signal=POWERS[power])
    return best


def _curves(signal: Array) -> Array:
    """Second and third power of a signal (n,), each less what lower ones and a constant make of it, of unit length, (2, n)."""
    x = signal - np.mean(signal)
    x = x / max(float(np.sqrt(np.mean(x**2))), 1e-300)
    Q, R = np.linalg.qr(np.stack([np.ones_like(x), x, x**2, x**3], axis=1))
    # A square wave is its own third power.
    new = np.abs(np.diag(R)) > 1e-6 * np.sqrt(x.size)
    return np.asarray(np.where(new, Q, 0.0)[:, 2:].T)


def _scale(pairs: np.ndarray, known: np.ndarray) -> Array:
    """What makes standard deviations of sums over pairs of samples of rows of unit length, (n_outputs,)."""
    if np.all(known):
        return np.full(len(known), np.sqrt(known.shape[1]))
    return np.asarray(np.sum(known, axis=1) / np.sqrt(np.maximum(np.sum(pairs, axis=1), 1)))


def _predictable(e: Array, u: Array, curves: Array, known: np.ndarray) -> Array:
    """Share of each channel's power that a regression on past, inputs and its own curves explains, adjusted for its size."""
    n = e.shape[1] - LAGS
    driven = [row[LAGS - k : LAGS - k + n] for row in u for k in range(LAGS)]
    shares = []
    for i, row in enumerate(e):
        regressors = np.array(
            [row[LAGS - k : LAGS - k + n] for k in range(1, LAGS + 1)] + driven + list(curves[i][:, LAGS:])
        )
        target = row[LAGS:]
        found = np.linalg.lstsq(regressors @ regressors.T, regressors @ target, rcond=1e-10)[0]
        left = target - found @ regressors
        samples = np.sum(known[i, LAGS:])
        if not samples:
            shares.append(0.0)
            continue
        freedom = max(samples - len(regressors), 1)
        shares.append(1 - (left @ left / freedom) / max(target @ target / max(samples, 1), 1e-300))
    return np.array(shares)


def _normalized(rows: Array, known: np.ndarray | None = None) -> Array:
    """Rows without their mean and of unit length; zero where a sample is not known."""
    if known is None or np.all(known):
        centred = rows - rows.mean(axis=1, keepdims=True)
    else:
        mean = np.sum(rows, axis=1, keepdims=True, where=known) / np.maximum(
            np.sum(known, axis=1, keepdims=True), 1
        )
        centred = np.where(known, rows - mean, 0.0)
    return np.asarray(centred / np.maximum(np.linalg.norm(centred, axis=1, keepdims=True), 1e-300))
