"""Test and model held against the criteria of the field, each with its source: pass, fail or undecided.

An error whose interval of two standard deviations holds the limit is undecided: better data could go either way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.special

from identification.recording import Array
from lab.compare import Pair
from lab.orthogonality import cross_orthogonality
from lab.result import Result, Validation

PASS, FAIL, UNDECIDED = "pass", "fail", "undecided"
COVERAGE = 2.0
"""Standard deviations on each side of a value."""
NASA = "NASA-STD-5002"
ECSS = "ECSS-E-ST-32-11C"
ASME = "ASME V&V 20-2009"


@dataclass(frozen=True)
class Limits:
    """Bounds that a model and a test must keep to count as correlated.

    Attributes:
        first_frequency_error: largest relative error of the lowest mode's frequency.
        frequency_error: likewise of the other modes.
        mac: smallest modal assurance criterion of a pair.
        cross_orthogonality: smallest entry of the cross-orthogonality of a mode with its partner.
        cross_orthogonality_off: largest entry with any other mode.

    Source: the usual values of NASA-STD-5002 and ECSS-E-ST-32-11C.
    """

    first_frequency_error: float = 0.03
    frequency_error: float = 0.05
    mac: float = 0.9
    cross_orthogonality: float = 0.9
    cross_orthogonality_off: float = 0.1


def validate(
    result: Result, limits: Limits | None = None, *, numerical_error: float = 0.0
) -> tuple[Validation, ...]:
    """Every criterion with what was reached and how it came out; none where there is no model or no pair of modes.

    Args:
        result: identified modes beside those of the model.
        limits: bounds; the usual ones when None.
        numerical_error: relative error of the simulation, as the recording tells it.

    Source: NASA-STD-5002 and ECSS-E-ST-32-11C for correlation; ASME V&V 20-2009 for the comparison error
        E = S - D against u_val² = u_num² + u_input² + u_D², where the inputs are known: u_input = 0.
    """
    limits = limits or Limits()
    pairs = () if result.comparison is None else result.comparison.pairs
    if not pairs:
        return ()
    frequency_std, damping_std = _relative_stds(result, pairs)
    lowest = [k for k, pair in enumerate(pairs) if pair.truth == 0]
    others = [k for k in range(len(pairs)) if k not in lowest]
    found = []
    wanted = [("frequency error of the lowest mode", lowest, limits.first_frequency_error, ECSS)]
    if result.truth_modes is not None and len(result.truth_modes) > 1:
        wanted.append(
            ("frequency error of the other modes", others, limits.frequency_error, f"{NASA}, {ECSS}")
        )
    for name, rows, limit, source in wanted:
        if not rows:
            where = "the model has a mode there, none was found"
            found.append(Validation(name, limit, False, None, None, UNDECIDED, where, source))
            continue
        errors = np.array([pairs[k].frequency_error for k in rows])
        stds = None if frequency_std is None else frequency_std[rows]
        found.append(_error(name, limit, errors, stds, [pairs[k].truth for k in rows], source))
    macs = np.array([pair.mac for pair in pairs])
    worst = int(np.argmin(macs))
    found.append(_at_least("MAC", limits.mac, float(macs[worst]), _mode(pairs[worst].truth), ECSS))
    found += _orthogonality(result, pairs, limits)
    for name, errors, stds in (
        ("frequency", np.array([pair.frequency_error for pair in pairs]), frequency_std),
        ("damping", np.array([pair.damping_error for pair in pairs]), damping_std),
    ):
        # A pole off by a share of its size moves the frequency by as much and the damping ratio by as much absolutely.
        scale = np.ones(len(pairs)) if name == "frequency" else 1 / _true_damping(result, pairs)
        found.append(_against_uncertainty(name, errors, stds, numerical_error * scale))
    return tuple(found)


def _true_damping(result: Result, pairs: Sequence[Pair]) -> Array:
    assert result.truth_modes is not None
    ratios = result.truth_modes.damping_ratio[[pair.truth for pair in pairs]]
    return np.where(ratios == 0, math.nan, np.abs(ratios))


def _relative_stds(result: Result, pairs: Sequence[Pair]) -> tuple[Array | None, Array | None]:
    """Standard deviations of frequency and damping over the model's values, pair by pair; None where not known."""
    modes, truth = result.modes, result.truth_modes
    assert truth is not None
    own, true = [pair.estimate for pair in pairs], [pair.truth for pair in pairs]
    frequency = None if modes.frequency_std is None else modes.frequency_std[own] / truth.frequency_hz[true]
    damping = None
    if modes.damping_std is not None:
        damping = modes.damping_std[own] / _true_damping(result, pairs)
    return frequency, damping


def _error(
    name: str, limit: float, errors: Array, stds: Array | None, modes: Sequence[int], source: str
) -> Validation:
    """The mode that decides: the largest error among those with the worst outcome."""
    size = np.abs(errors)
    margin = np.zeros(size.size) if stds is None else COVERAGE * np.nan_to_num(stds)
    rank = np.where(size - margin > limit, 2, np.where(size + margin > limit, 1, 0))
    worst = int(np.argmax(np.where(rank == rank.max(), size, -1.0)))
    outcome = (PASS, UNDECIDED, FAIL)[int(rank.max())]
    std = None if stds is None or not math.isfinite(stds[worst]) else float(stds[worst])
    return Validation(name, limit, False, float(size[worst]), std, outcome, _mode(modes[worst]), source)


def _at_least(name: str, limit: float, value: float, where: str, source: str) -> Validation:
    # A value that rounding took below a limit of 1 is no failure.
    outcome = PASS if value >= limit - 1e-12 else FAIL
    return Validation(name, limit, True, value, None, outcome, where, source)


def _orthogonality(result: Result, pairs: Sequence[Pair], limits: Limits) -> list[Validation]:
    source = f"{NASA}, {ECSS}"
    names = ("cross-orthogonality, same mode", "cross-orthogonality, other modes")
    found = cross_orthogonality(result)
    if found is None:
        where = "needs the model's masses and shapes at more points than modes"
        return [
            Validation(names[0], limits.cross_orthogonality, True, None, None, UNDECIDED, where, source),
            Validation(names[1], limits.cross_orthogonality_off, False, None, None, UNDECIDED, where, source),
        ]
    X = np.abs(found.values)
    own = np.diagonal(X)
    worst = int(np.argmin(own))
    points = f"{len(found.dofs)} of {found.n_dofs} degrees of freedom"
    where = f"{_mode(pairs[worst].truth)}, {points}"
    rows = [_at_least(names[0], limits.cross_orthogonality, float(own[worst]), where, source)]
    if len(pairs) > 1:
        off = X - np.diag(own)
        i, j = (int(k) for k in np.unravel_index(int(np.argmax(off)), off.shape))
        where = f"modes {pairs[i].truth + 1} and {pairs[j].truth + 1}, {points}"
        outcome = PASS if off[i, j] <= limits.cross_orthogonality_off else FAIL
        rows.append(
            Validation(
                names[1],
                limits.cross_orthogonality_off,
                False,
                float(off[i, j]),
                None,
                outcome,
                where,
                source,
            )
        )
    return rows


def _against_uncertainty(
    quantity: str, errors: Array, stds: Array | None, numerical: float | Array
) -> Validation:
    """RMS over the modes of E / u_val; its limit is exceeded by chance as rarely as 2 is for one mode."""
    name = f"{quantity}: comparison error over validation uncertainty"
    known = np.isfinite(errors)
    if stds is not None:
        known = known & np.isfinite(stds)
    n = int(np.sum(known))
    limit = _chance_limit(max(n, 1))
    if stds is None or not n:
        return Validation(name, limit, False, None, None, UNDECIDED, "no error bars are known", ASME)
    u = np.sqrt(stds**2 + np.asarray(numerical) ** 2)[known]
    if not np.all(u > 0):
        return Validation(name, limit, False, None, None, UNDECIDED, "an error bar is zero", ASME)
    value = float(np.sqrt(np.mean((errors[known] / u) ** 2)))
    where = f"{n} mode{'s' if n > 1 else ''}"
    return Validation(name, limit, False, value, None, PASS if value <= limit else FAIL, where, ASME)


def _chance_limit(n: int) -> float:
    """Bound of the RMS of n independent standard normal errors, at the probability of ± `COVERAGE` for one."""
    probability = scipy.special.erf(COVERAGE / math.sqrt(2))
    # The sum of n squares is below twice this with that probability (chi-square with n degrees of freedom).
    half = float(scipy.special.gammaincinv(n / 2, probability))
    return math.sqrt(2 * half / n)


def _mode(truth: int) -> str:
    return f"mode {truth + 1}"
