"""Remark: one thing that a technician would point at before any analysis."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from identification.recording import Channel, Record

SEVERITIES = ("fault", "doubt", "note")
"""Not to be used as it is; to be looked at; good to know."""


@dataclass(frozen=True)
class Remark:
    """What was noticed, where, on which evidence, and what to do about it.

    Attributes:
        check: name of the check, one of `CHECKS`.
        channel: names of the channels concerned, joined by "|"; empty for the recording as a whole.
        severity: one of `SEVERITIES`.
        says: what was noticed, without the channel.
        advice: one sentence on what to do.
        record: number of the first record in which it shows.
        start: where it begins in that record [s].
        stop: where it ends [s].
        evidence: numbers by name; the name ends in its unit where there is one.
    """

    check: str
    channel: str
    severity: str
    says: str
    advice: str
    record: int = 0
    start: float = 0.0
    stop: float = 0.0
    evidence: Mapping[str, float] = field(default_factory=dict)

    def to_data(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return dataclasses.asdict(self) | {"evidence": dict(self.evidence)}


@dataclass(frozen=True)
class Trace:
    """One channel of one record, by its place: row `row` of `survey.stacked` of record `number`."""

    number: int
    record: Record
    row: int
    channel: Channel
    is_input: bool
