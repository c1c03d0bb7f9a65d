"""What a test comes to: the modes and matrices found, the truth where there is one, and the comparison of both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from identification.likelihood import Estimate
from identification.modes import Modes
from identification.stability import Stabilization
from identification.systems import Realization, SecondOrder

if TYPE_CHECKING:
    from lab.compare import Comparison


@dataclass(frozen=True)
class Criterion:
    """One requirement of a scenario and how it came out.

    Attributes:
        name: what is required, as in the scenario file.
        limit: the required bound.
        value: what was reached; None when it could not be had.
        passed: whether it is fulfilled.
    """

    name: str
    limit: float
    value: float | None
    passed: bool


@dataclass(frozen=True)
class Validation:
    """One criterion of the field and how it came out.

    Attributes:
        name: what is held against the model.
        limit: the bound.
        at_least: whether the value must reach the bound, not stay within it.
        value: what was reached; None when it could not be had.
        std: one standard deviation of the value; None where it is not known.
        outcome: "pass", "fail" or "undecided".
        where: the mode that decides, and on how many points.
        source: who uses the criterion.
    """

    name: str
    limit: float
    at_least: bool
    value: float | None
    std: float | None
    outcome: str
    where: str
    source: str


@dataclass(frozen=True, eq=False)
class Result:
    """Everything that `result.json` and the report tell of one identification.

    Attributes:
        title: what was tested.
        sample_rate: of the recording [Hz]; infinite for responses to forces that vary continuously.
        modes: identified modes, sorted by frequency.
        stable: whether each mode stayed put over the model orders.
        second_order: identified M, C, K, or None.
        realization: state-space models that the modes come from.
        stabilization: poles of every order and what became of them; None when one order was asked for.
        truth_modes: modes of the model that made the data, at the same outputs, or None.
        truth_second_order: its M, C, K, or None.
        comparison: estimate against truth, or None.
        criteria: requirements of the scenario.
        validation: criteria of the field, where there is a truth.
        warnings: what a careful reader should know, one sentence each.
        notes: what the method chose by itself and why, one sentence each.
        explanation: one paragraph on method, order and horizon, modes kept and poles rejected.
        refinement: the maximum of the likelihood that modes and matrices were moved to, or None.
    """

    title: str
    sample_rate: float
    modes: Modes
    stable: tuple[bool, ...]
    second_order: SecondOrder | None
    realization: Realization
    stabilization: Stabilization | None
    truth_modes: Modes | None = None
    truth_second_order: SecondOrder | None = None
    comparison: Comparison | None = None
    criteria: tuple[Criterion, ...] = ()
    validation: tuple[Validation, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    explanation: str = ""
    refinement: Estimate | None = None
