"""What a result comes to in one plain sentence, and the tables it rests on."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lab.criteria import AT_LEAST
from lab.result import Criterion, Result

PASSED, FAILED, FOUND = "passed", "failed", "found"


@dataclass(frozen=True)
class Verdict:
    """The outcome and the sentence that says it.

    Attributes:
        outcome: "passed" or "failed" where there are criteria, else "found".
        sentence: one sentence for an engineer.
    """

    outcome: str
    sentence: str


@dataclass(frozen=True)
class ModeRow:
    """One line of the table of modes; None where there is nothing to say.

    Attributes:
        number: of the identified mode, from 1; None for a mode of the truth that was missed.
        stable: whether it stayed put over the model orders.
        frequency, frequency_std, damping, damping_std: identified [Hz, 1].
        true_frequency, true_damping: of the model that made the data.
        frequency_error, damping_error: signed, relative to the truth.
        mac: of the two shapes.
    """

    number: int | None
    stable: bool | None
    frequency: float | None
    frequency_std: float | None
    damping: float | None
    damping_std: float | None
    true_frequency: float | None = None
    true_damping: float | None = None
    frequency_error: float | None = None
    damping_error: float | None = None
    mac: float | None = None


def verdict(result: Result) -> Verdict:
    """The outcome of the scenario's criteria, else of those of the field, else what was found."""
    if not result.criteria:
        return _of_the_field(result) if result.validation else Verdict(FOUND, _found(result))
    n, missed = len(result.criteria), [criterion for criterion in result.criteria if not criterion.passed]
    if missed:
        reasons = "; ".join(_shortfall(criterion) for criterion in missed)
        return Verdict(
            FAILED, f"Failed: {len(missed)} of {counted(n, 'criterion', 'criteria')} missed: {reasons}."
        )
    met = {1: "the criterion is met", 2: "both criteria are met"}.get(n, f"all {n} criteria are met")
    return Verdict(PASSED, f"Passed: {met}. {_found(result)}")


def _of_the_field(result: Result) -> Verdict:
    """The outcome of the criteria of the field: failed by one, undecided by one, or passed by all."""
    outcomes = [each.outcome for each in result.validation]
    named = {
        kind: ", ".join(each.name for each in result.validation if each.outcome == kind)
        for kind in ("fail", "undecided")
    }
    if "fail" in outcomes:
        return Verdict(FAILED, f"Failed by the criteria of the field: {named['fail']}. {_found(result)}")
    if "undecided" in outcomes:
        text = f"Undecided by the criteria of the field: {named['undecided']}. {_found(result)}"
        return Verdict(FOUND, text)
    return Verdict(PASSED, f"Passed: all criteria of the field are met. {_found(result)}")


def bound(criterion: Criterion) -> str:
    """The limit with the side on which it holds."""
    return f"{'at least' if criterion.name in AT_LEAST else 'at most'} {criterion.limit:g}"


def _shortfall(criterion: Criterion) -> str:
    reached = "could not be had" if criterion.value is None else f"is {criterion.value:.3g}"
    return f"{words(criterion.name)} {reached}, required {bound(criterion)}"


def words(name: str) -> str:
    """A criterion's name as one reads it."""
    return {"mac": "MAC", "modes": "number of modes"}.get(name, name.replace("_", " "))


def _found(result: Result) -> str:
    """Modes and matrices in one sentence."""
    modes, comparison = result.modes, result.comparison
    if comparison is None:
        if not len(modes):
            return "No mode was found."
        low, high = modes.frequency_hz[0], modes.frequency_hz[-1]
        span = f"at {low:.4g} Hz" if len(modes) == 1 else f"between {low:.4g} and {high:.4g} Hz"
        stable = sum(result.stable)
        how = (
            ""
            if result.stabilization is None or stable == len(modes)
            else f", {stable} of them stable over the model orders"
        )
        return f"{counted(len(modes), 'mode was', 'modes were')} found {span}{how}."
    n_true = len(comparison.pairs) + len(comparison.missed)
    parts = []
    if comparison.pairs:
        worst_frequency = max(abs(pair.frequency_error) for pair in comparison.pairs)
        # A structure without damping has no relative damping error.
        damping = [abs(pair.damping_error) for pair in comparison.pairs if math.isfinite(pair.damping_error)]
        damping_part = f"damping ratios within {percent(max(damping))}, " if damping else ""
        worst_mac = min(pair.mac for pair in comparison.pairs)
        agreement = "1" if lowered(worst_mac) == "1" else f"at least {lowered(worst_mac)}"
        parts.append(
            f"{len(comparison.pairs)} of {counted(n_true, 'true mode')} found, "
            f"frequencies within {percent(worst_frequency)}, {damping_part}MAC {agreement}"
        )
    else:
        parts.append(f"none of {counted(n_true, 'true mode')} was found")
    errors = {"M": comparison.mass_error, "C": comparison.damping_error, "K": comparison.stiffness_error}
    known = {name: error for name, error in errors.items() if error is not None}
    if known:
        parts.append(f"{', '.join(known)} recovered within {max(known.values()):.1e} of the largest entry")
    sentence = "; ".join(parts)
    if comparison.extra:
        sentence += f"; {counted(len(comparison.extra), 'mode')} found that the model does not have"
    return sentence[0].upper() + sentence[1:] + "."


def mode_rows(result: Result) -> list[ModeRow]:
    """Identified modes beside their true partners, then the true modes that were missed."""
    modes, truth = result.modes, result.truth_modes
    pairs = {pair.estimate: pair for pair in result.comparison.pairs} if result.comparison else {}
    rows = []
    for i in range(len(modes)):
        f_std, z_std = (
            None if std is None else float(std[i]) for std in (modes.frequency_std, modes.damping_std)
        )
        own = (
            i + 1,
            result.stable[i],
            float(modes.frequency_hz[i]),
            f_std,
            float(modes.damping_ratio[i]),
            z_std,
        )
        pair = pairs.get(i)
        if pair is None or truth is None:
            rows.append(ModeRow(*own))
            continue
        f, z = float(truth.frequency_hz[pair.truth]), float(truth.damping_ratio[pair.truth])
        rows.append(ModeRow(*own, f, z, pair.frequency_error, pair.damping_error, pair.mac))
    if result.comparison and truth is not None:
        for i in result.comparison.missed:
            f, z = float(truth.frequency_hz[i]), float(truth.damping_ratio[i])
            rows.append(ModeRow(None, None, None, None, None, None, f, z))
    return rows


def percent(ratio: float) -> str:
    """A relative error in percent, or in scientific notation where percent would hide it behind zeros."""
    return f"{100 * ratio:.2g} %" if ratio >= 1e-4 else f"{ratio:.1e}"


def lowered(mac: float) -> str:
    """A MAC cut after the first digit that tells it from 1, so that it is never rounded up."""
    if mac >= 1 - 1e-12:
        return "1"
    decimals = max(2, math.ceil(-math.log10(1 - mac)))
    return f"{math.floor(mac * 10**decimals) / 10**decimals:.{decimals}f}"


def counted(n: int, one: str, many: str = "") -> str:
    """A number of things in words; the plural has an s unless it is given."""
    return f"{n} {one if n == 1 else many or one + 's'}"
