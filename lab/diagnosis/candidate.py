"""Candidate: a cause that may be named, fitted, with the evidence for it."""

from __future__ import annotations

from dataclasses import dataclass

from identification.recording import Array
from lab.diagnosis.evidence import minus_two_log_evidence
from lab.diagnosis.fit import Fit


@dataclass(frozen=True, eq=False)
class Candidate:
    """A cause at a place with the evidence for it.

    Attributes:
        cause: name of the cause.
        location: where it sits.
        fit: with it.
        gain: 2 log evidence gained over the model without it.
        guided: the fit on its way, while measurements still guided the state.
        direction: among the model's parameters, for a change of what the model has already.
        beside: direction of a second such change without which this one does not show; the gain is half of what both bring.
    """

    cause: str
    location: str
    fit: Fit
    gain: float
    direction: Array | None = None
    guided: Fit | None = None
    beside: Array | None = None


def last_of(found: Fit, guided: Fit | None, without: float) -> Candidate:
    """The last cause of a fit, against the -2 log evidence without it."""
    last = found.causes[-1]
    gain = without - minus_two_log_evidence(found)
    return Candidate(last.kind.cause, last.location, found, gain, guided=guided)
