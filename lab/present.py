"""What a user gets to see of a result: numbers, a report, and the structure in motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.excitation import Excitation
from lab.files.checksum import sha256_of
from lab.files.results import save_result
from lab.loads import Load, Sampling
from lab.result import Result
from lab.rig import Rig
from lab.scenario import Scenario
from lab.simulate import Motion, motion

PERIODS_SHOWN = 20
"""Length of the motion kept for the viewer, in periods of the lowest mode."""
COSTS = 1.5, 3.0, 1.0
"""Seconds that loading what draws, the report, and what the viewer shows take, typically."""


def present(
    folder: Path,
    result: Result,
    recording: Recording | FrequencyResponse,
    *,
    command: str = "",
    scenario: Scenario | None = None,
    rig: Rig | None = None,
    source: str | Path | None = None,
    work: Work = UNHEARD,
) -> None:
    """Write result.json, report.html and run.rrd into a folder.

    Args:
        folder: to write into.
        result: what to tell.
        recording: what it was identified from: samples, or frequency responses.
        command: how the lab was called.
        scenario: the test behind it, if there is one.
        rig: the rig behind it, if there is one.
        source: file that the recording was read from, if it was given.
        work: told how much of this is done.
    """
    # Imported here because drawing is slow to load and `lab` must come up without it.
    from lab.show.report import write_report
    from lab.show.rerun_log import write_rrd

    loading, reporting, showing = work.parts(*COSTS)
    loading.done()
    save_result(result, folder / "result.json")
    write_report(
        folder / "report.html",
        result,
        recording,
        scenario_text=scenario.text if scenario else "",
        command=command,
        facts=_given(source, scenario) | _facts(recording, rig, scenario),
        work=reporting,
    )
    showing.done(0.0)
    moved = _first_swings(rig, scenario) if rig and scenario else None
    write_rrd(folder / "run.rrd", result, recording, rig=rig, motion=moved)


def _given(source: str | Path | None, scenario: Scenario | None) -> dict[str, str]:
    """The files that the result rests on, with their checksums."""
    files = {} if source is None else {"Recording": Path(source)}
    if scenario is not None:
        files["Model file"] = scenario.model_file()
    return {name: f"{path}, SHA-256 {sha256_of(path)}" for name, path in files.items()}


def _facts(
    recording: Recording | FrequencyResponse, rig: Rig | None, scenario: Scenario | None
) -> dict[str, str]:
    """What it takes to repeat the test, besides what the report knows by itself."""
    facts = {
        "Inputs": ", ".join(channel.name for channel in recording.inputs) or "none",
        "Outputs": ", ".join(channel.name for channel in recording.outputs),
    }
    if rig is not None:
        facts["Model"] = f"{rig.name}, degrees of freedom {', '.join(rig.dofs)}"
    if scenario is not None:
        facts["Seed"] = str(scenario.seed)
    attributes = recording.attributes if isinstance(recording, Recording) else {}
    for name, value in attributes.items():
        facts[name.replace("_", " ").capitalize()] = value if isinstance(value, str) else f"{value:g}"
    return facts


def _first_swings(rig: Rig, scenario: Scenario) -> Motion:
    """The start of the first record, long enough to watch."""
    test = scenario.test
    lowest = rig.second_order().modes().frequency_hz[:1]
    enough = PERIODS_SHOWN / lowest[0] if lowest.size else test.duration
    return motion(
        rig,
        _Start(scenario.drive(), round(test.duration * test.sample_rate)),
        sample_rate=test.sample_rate,
        duration=min(test.duration, enough),
        seed=scenario.seed,
    )


@dataclass(frozen=True)
class _Start(Excitation):
    """The start of a longer test: what a sweep or multisine does depends on the whole length."""

    whole: Excitation
    n_samples: int

    def loads(self, rig: Rig, sampling: Sampling, rng: np.random.Generator) -> list[Load]:
        loads = self.whole.loads(rig, replace(sampling, n_samples=self.n_samples), rng)
        return [replace(load, n_samples=sampling.n_samples) for load in loads]
