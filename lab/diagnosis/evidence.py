"""Evidence: how much more probable the data are with a cause than without, the many possibilities paid for."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.special

from identification.recording import Array
from lab.diagnosis.fit import Fit

SPREADS = np.geomspace(0.1, 6.0, 15)
"""Spreads of the model's errors that are compared, in widths of the prior: the data say how good the model is."""
DOUBT = float(np.log(2))
"""How far the stated widths may be off: a factor of two is one standard deviation."""

STRETCH = 4
"""Length of the stretches of time that count as independent, in samples that count as one."""
LEVEL = 0.05
"""Probability that two fits that are as good as each other seem not to be."""


def minus_two_log_evidence(fit: Fit, *, free: Array | None = None) -> float:
    """-2 log evidence of a fit up to a constant, the spread of the model's errors estimated with it.

    Parameters of the model are integrated out by Laplace's method; the variables of causes, whose priors are vague, cost
    one log n each (Schwarz 1978).

    Args:
        fit: a converged fit.
        free: a direction among the parameters, or several as rows, whose prior is lifted: "this one is wrong" without any
            refit, since a second factor beside the parameter would be degenerate with it.
    """
    n, total = fit.theta.size, fit.residual.size
    information, theta, prior = _of_parameters(fit.information, n), fit.theta, fit.precision
    lifted = [np.linalg.eigh(prior)[1][:, k] for k in np.flatnonzero(np.linalg.eigvalsh(prior) < 0.5)]
    if free is not None:
        lifted += [row / np.linalg.norm(row) for row in np.atleast_2d(free)]
    loose = np.array(lifted).reshape(-1, n).T  # directions without a prior
    held = scipy.linalg.null_space(loose.T) if loose.size else np.eye(n)
    told = np.arange(n) < fit.n_structural
    n_told = float(np.sum(held[told] ** 2))
    best = np.inf
    for spread in SPREADS:
        widths = np.where(told, spread, 1.0)
        precision = held @ (held.T / widths**2) @ held @ held.T
        A = information + precision
        d = np.linalg.lstsq(A, prior @ theta - precision @ theta, rcond=None)[0]
        inner = held.T @ A @ held
        if loose.size:
            cross, own = held.T @ A @ loose, loose.T @ A @ loose
            inner = inner - cross @ np.linalg.pinv(own, hermitian=True) @ cross.T
        # The local quadratic may not promise more than the prior made the fit pay.
        change = max(d @ information @ d - 2 * d @ prior @ theta, -(theta @ prior @ theta))
        occam = np.linalg.slogdet(inner)[1] + 2 * n_told * np.log(spread)
        doubt = (np.log(spread) / DOUBT) ** 2
        best = min(best, fit.deviance + change + (theta + d) @ precision @ (theta + d) + occam + doubt)
    variables = sum(max(cause.n, 1) for cause in fit.causes) + loose.shape[1]
    return float(best + variables * np.log(total))


def undecided(told: Fit, other: Fit, colour: float) -> float:
    """Log likelihood ratio of two fits of the same data that chance exceeds once in twenty, told by its parts over time.

    Where models err by more than noise, errors decide between causes that are both wrong somewhere (Vuong 1989, Econometrica
    57, 307-333, section 4; over stretches of time instead of samples, as errors stay alike for a while, and by Student's
    distribution, as a short record has few of them).

    Args:
        told, other: fits, with residuals (n_outputs, n).
        colour: samples that count as one.
    """
    a, b = (
        fit.residual**2 / np.maximum(np.mean(fit.residual**2, axis=1, keepdims=True), 1e-300)
        for fit in (told, other)
    )
    share = (b - a).sum(axis=0) / (2 * colour)
    n_parts = max(share.size // int(np.ceil(STRETCH * colour)), 2)
    parts = np.array([part.sum() for part in np.array_split(share, n_parts)])
    return float(scipy.special.stdtrit(n_parts - 1, 1 - LEVEL / 2) * np.sqrt(n_parts) * parts.std(ddof=1))


def _of_parameters(information: Array, n: int) -> Array:
    """Information on the first n variables when the others are fitted too."""
    inner = information[:n, :n]
    if information.shape[0] > n:
        cross, own = information[:n, n:], information[n:, n:]
        inner = inner - cross @ np.linalg.pinv(own, rcond=1e-10, hermitian=True) @ cross.T
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    return np.asarray((vectors * np.maximum(values, 0)) @ vectors.T)
