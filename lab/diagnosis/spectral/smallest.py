"""Smallest: how large a change must be for these data to name it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.optimize

from identification.recording import Array
from lab.diagnosis.changes import OWN_PARAMETERS
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.screening import hypotheses
from lab.diagnosis.spectral.fit import SpectralFit, fit, point, slopes
from lab.diagnosis.spectral.likelihood import Likelihood
from lab.effects.effect import Effect

STEP = 1e-3
"""Of a drift, in units of its scale."""
ENDS = 5
"""Parameters told at either end where there are many."""
LARGEST = float(np.log(1e3))
"""A change of the logarithm of a factor beyond which none is looked for."""


class Smallest(NamedTuple):
    """The smallest change of one kind that these data name.

    Attributes:
        location: where.
        size: of the logarithm of a factor, or of the relative change over the record.
    """

    location: str
    size: float


def smallest_changes(likelihood: Likelihood, found: SpectralFit, needed: float) -> dict[str, list[Smallest]]:
    """Smallest change of masses, stiffnesses and dampings that is named, by cause, smallest first.

    Of many of a kind only those are told that the data see best and worst.

    Args:
        likelihood: model and data.
        found: the model's parameters at their most likely values.
        needed: 2 log evidence that a cause must gain to be named.

    Source: as for `_gained`.
    """
    parameters, n = likelihood.parameters, found.theta.size
    named: dict[str, list[Smallest]] = {}
    for group, cause in OWN_PARAMETERS.items():
        sizes = []
        for j in _extremes(found, [j for j in parameters.group(group) if parameters.widths[j] > 0]):
            free = parameters.lifted(np.eye(n)[j]).precision

            def gain(x: float, j: int = j, free: Array = free) -> float:
                there = replace(_exact(found), theta=x * np.eye(n)[j], precision=free)
                return _gained(found, found.information[:, j], found.information[j, j], x) - _cost(there)

            width = float(parameters.widths[j])
            sizes.append(Smallest(parameters.names[j].partition(" ")[2], _least(gain, needed, width)))
        named[cause] = sorted(sizes, key=lambda each: each.size)
    return named


def _extremes(found: SpectralFit, members: Sequence[int]) -> list[int]:
    """The parameters that the data see best and worst beside all others, all where they are few."""
    if len(members) <= 2 * ENDS:
        return list(members)
    variance = np.diag(found.covariance)
    ranked = sorted(members, key=lambda j: float(variance[j]))
    return [*ranked[:ENDS], *ranked[-ENDS:]]


def smallest_drifts(
    parts: Likelihood, found: SpectralFit, kind: type[Effect], needed: float
) -> list[Smallest]:
    """Smallest relative change of every spring over the record that is named, smallest first, from spectra of its parts.

    Args:
        parts: likelihood of consecutive parts of the records.
        found: as for `smallest_changes`.
        kind: of a drift.
        needed: likewise.

    Source: as for `_gained`.
    """
    base = fit(parts, found.theta, found.causes, found.nuisance, iterations=4, tolerance=0.5)
    at = point(parts, base.theta, base.causes, base.nuisance)
    J = slopes(parts, at)
    there = _cost(_exact(base)) + float(np.log(base.residual.size))
    sizes = []
    for h in hypotheses(parts, {kind.cause: kind}):  # type: ignore[arg-type]
        moved = parts.predict(at.theta, [*at.causes, h.at(h.values + STEP)], at.nuisance)
        row = parts.whitened(at.predicted, ((moved - at.predicted) / STEP)[None])[0]
        cross, own = J @ row, float(row @ row)

        def gain(x: float, cross: Array = cross, own: float = own) -> float:
            return _gained(base, cross, own, x) - there

        (scale,) = h.guess.scale.values()
        sizes.append(Smallest(h.location, scale * _least(gain, needed, 1.0)))
    return sorted(sizes, key=lambda each: each.size)


def _gained(found: SpectralFit, cross: Array, own: float, x: float) -> float:
    """-2 log evidence of the calibrated model where a change of size x is true that it does not have.

    The calibration takes up what its priors allow of the change, as do forces and noise; the rest is misfit. All is taken for
    linear in the change, and noise left out.

    Args:
        found: calibration, whose information counts.
        cross: information between all its variables and the change, (n_variables,).
        own: information on the change.
        x: its size.

    Source: Kay (1998), Fundamentals of Statistical Signal Processing II, section 6.5, the noncentrality of the likelihood
        ratio, with the evidence in place of the likelihood.
    """
    n = found.theta.size
    total = found.information.copy()
    total[:n, :n] += found.precision
    taken = x * np.linalg.pinv(total, rcond=1e-13, hermitian=True) @ cross
    misfit = x**2 * own - 2 * x * float(cross @ taken) + float(taken @ found.information @ taken)
    theta = taken[:n]
    objective = misfit + float(theta @ found.precision @ theta)
    return _cost(replace(found, theta=theta, objective=objective))


def _exact(found: SpectralFit) -> SpectralFit:
    """The calibration of a model that is true."""
    return replace(found, theta=np.zeros(found.theta.size), objective=0.0)


def _least(gain: Callable[[float], float], needed: float, width: float) -> float:
    """The smallest change that gains what is needed, to a percent, in units in which a prior has that width."""
    if gain(LARGEST / width) < needed:
        return np.inf
    if gain(0.0) >= needed:
        return 0.0

    def short(square: float) -> float:
        return gain(np.sqrt(square) / width) - needed

    # What is gained grows about as the square, on which few trials find the root.
    root = scipy.optimize.brentq(short, 0.0, LARGEST**2, xtol=1e-12, rtol=0.02)
    return float(np.sqrt(root))


def _cost(found: SpectralFit) -> float:
    return minus_two_log_evidence(found)  # type: ignore[arg-type]


def in_words(changes: dict[str, list[Smallest]], drifts: list[Smallest] | None) -> tuple[str, ...]:
    """One sentence on each kind of change.

    Args:
        changes: as from `smallest_changes`.
        drifts: as from `smallest_drifts`; None where the record has no parts to compare.
    """
    said = [
        f"a {cause.replace('_', ' ')} alone is named from {_factor(sizes[0])} to {_factor(sizes[-1])} on, by where it is; "
        "a smaller one counts as calibration"
        for cause, sizes in changes.items()
        if sizes
    ]
    if drifts is None:
        said.append(
            "the record is too short to tell a spring that drifts from one that is changed; record longer"
        )
    elif drifts:
        first, last = drifts[0], drifts[-1]
        said.append(
            f"a stiffness drift is named from {_share(first)} to {_share(last)} of the stiffness over the record on, by where "
            "it is; record longer for smaller ones"
        )
    return tuple(said)


def _factor(each: Smallest) -> str:
    if not np.isfinite(each.size):
        return f"no size at {each.location}"
    share = np.expm1(each.size)
    size = f"{100 * share:.2g} %" if share < 1 else f"a factor of {1 + share:.2g}"
    return f"{size} ({each.location})"


def _share(each: Smallest) -> str:
    return f"{100 * each.size:.2g} % ({each.location})" if each.size < 1 else f"all ({each.location})"
