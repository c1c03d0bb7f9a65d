"""Why an identification came out as it did, in one paragraph."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from identification.stability import STABLE, Stabilization

PHRASES = {
    "negative damping": "growing in time",
    "damping too high": "too high a damping to oscillate",
    "complex shape": "a shape without a common phase",
    "lowest order": "want of a lower order to compare with",
    "frequency jumps": "a frequency that jumps from order to order",
    "shape jumps": "a shape that jumps",
    "damping jumps": "a damping ratio that jumps",
    "double": "doubling another pole of their order",
    "cluster too small": "agreeing at too few orders to be told from chance",
}
"""Rule that rejects a pole -> what it is rejected for."""


def explanation(
    notes: Sequence[str],
    stabilization: Stabilization | None,
    stable: Sequence[bool],
    after: Sequence[str] = (),
) -> str:
    """One paragraph: method, order and horizon, then modes kept and poles rejected by each rule, then the rest.

    Args:
        notes: on the method, its order and horizon, one sentence each.
        stabilization: poles of all orders; None where there is one order.
        stable: whether each mode found stays put over the orders.
        after: on error bars, matrices and refinement, one sentence each.

    Returns:
        Sentences with a blank between them, without repetition.
    """
    poles = () if stabilization is None else _on_poles(stabilization, stable)
    return " ".join(dict.fromkeys([*notes, *poles, *after]))


def _on_poles(found: Stabilization, stable: Sequence[bool]) -> tuple[str, ...]:
    """How many poles make up the modes, what speaks against the others, and which modes did not settle."""
    counts = Counter(found.label)
    kept = counts.pop(STABLE, 0)
    n = len(found.modes)
    sentence = f"Of {len(found.label)} poles of all orders, {kept} stay put and make up {n} mode{'s' if n != 1 else ''}"
    if counts:
        reasons = [f"{number} for {PHRASES.get(rule, rule)}" for rule, number in counts.most_common()]
        sentence += f"; the others were rejected, {_listed(reasons)}"
    n_loose = len(stable) - sum(stable)
    if not n_loose:
        return (sentence + ".",)
    loose = "1 mode" if n_loose == 1 else f"{n_loose} modes"
    return (sentence + ".", f"Of the modes of the order taken, {loose} did not stay put and may be noise.")


def _listed(items: Sequence[str]) -> str:
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"
