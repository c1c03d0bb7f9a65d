"""Evidence: how much more probable the data are with a cause than without, the many possibilities paid for."""

from __future__ import annotations

import numpy as np

from identification.recording import Array
from lab.diagnosis.fit import Fit

TOLERANCES = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Spreads of the model's errors that are compared, in widths of the prior: the data say how good the model is."""


def minus_two_log_evidence(fit: Fit, *, free: int | None = None) -> float:
    """-2 log evidence of a fit up to a constant, the spread of the model's errors estimated with it.

    Parameters of the model are integrated out by Laplace's method; the variables of causes, whose priors are vague, cost
    one log n each (Schwarz 1978).

    Args:
        fit: a converged fit.
        free: a parameter of the model whose prior is lifted: "this one is wrong" without any refit, since a second
            factor beside the parameter would be degenerate with it.
    """
    n, total = fit.theta.size, fit.residual.size
    information = _of_parameters(fit.information, n)
    theta = fit.theta
    best = np.inf
    for spread in TOLERANCES:
        precision = np.full(n, 1 / spread**2)
        known = np.ones(n, dtype=bool)
        if free is not None:
            precision[free], known[free] = 1e-6, False
        A = information + np.diag(precision)
        d = np.linalg.solve(A, theta - precision * theta)
        inner = A[np.ix_(known, known)]
        if free is not None:
            inner = inner - np.outer(A[known, free], A[free, known]) / A[free, free]
        # The local quadratic may not promise more than the prior made the fit pay.
        change = max(d @ information @ d - 2 * theta @ d, -(theta @ theta))
        occam = np.linalg.slogdet(inner)[1] - np.sum(np.log(precision[known]))
        best = min(best, fit.deviance + change + precision @ (theta + d) ** 2 + occam)
    variables = sum(max(cause.n, 1) for cause in fit.causes) + (free is not None)
    return float(best + variables * np.log(total))


def _of_parameters(information: Array, n: int) -> Array:
    """Information on the first n variables when the others are fitted too."""
    inner = information[:n, :n]
    if information.shape[0] > n:
        cross, own = information[:n, n:], information[n:, n:]
        inner = inner - cross @ np.linalg.pinv(own, rcond=1e-10, hermitian=True) @ cross.T
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    return np.asarray((vectors * np.maximum(values, 0)) @ vectors.T)
