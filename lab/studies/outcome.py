"""What a study comes to, ready for JSON, screen and report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lab.files.document import plain
from lab.studies.plan import Study
from lab.studies.statistics import Statistic

FORMAT = "modal-study"
VERSION = 1


@dataclass(frozen=True, eq=False)
class Outcome:
    """The statistics of a study.

    Attributes:
        study: what was asked.
        statistics: per point.
        failures: how many runs failed with each error, of the first twenty different ones.
        n_failed: number of runs that failed.
        absent: names collected that no run has.
    """

    study: Study
    statistics: tuple[Statistic, ...]
    failures: Mapping[str, int]
    n_failed: int
    absent: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Statistic:
        """The statistic of that name.

        Raises:
            KeyError: there is none; the message lists those there are.
        """
        for each in self.statistics:
            if each.name == name:
                return each
        raise KeyError(f"no statistic {name!r}; there are {', '.join(each.name for each in self.statistics)}")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a careful reader should know, one sentence each."""
        told = [f"{n} run{'s' if n > 1 else ''} failed: {error}" for error, n in self.failures.items()]
        rest = self.n_failed - sum(self.failures.values())
        if rest:
            told.append(f"{rest} more runs failed, with other errors; study.h5 has them all")
        for name in self.absent:
            told.append(
                f"{name} = {self.study.collect[name]!r} of [collect] is in no run; check its spelling"
            )
        return tuple(told)


def study_document(outcome: Outcome) -> dict[str, Any]:
    """What `lab study --json` prints, as plain lists, numbers and texts; None for a number that is not finite."""
    study = outcome.study
    return dict(
        plain(
            {
                "format": FORMAT,
                "version": VERSION,
                "title": study.title,
                "runs": study.n_runs,
                "failed": outcome.n_failed,
                "repeats": study.repeats,
                "points": [
                    {"setting": study.setting(point), "statistics": _at(outcome, point)}
                    for point in range(study.n_points)
                ],
                "warnings": list(outcome.warnings),
            }
        )
    )


def _at(outcome: Outcome, point: int) -> dict[str, Any]:
    return {
        each.name: {
            "value": each.value[point],
            "low": each.low[point],
            "high": each.high[point],
            "runs": each.n[point],
        }
        for each in outcome.statistics
        if math.isfinite(each.value[point])
    }
