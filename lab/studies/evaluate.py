"""One run of a study, in memory: simulated, identified, diagnosed where asked, and held against the truth."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lab.diagnosis.diagnose import diagnose
from lab.diagnosis.judge import judge_diagnosis
from lab.errors import StudyError
from lab.files.diagnosis import diagnosis_document
from lab.files.document import plain
from lab.files.results import result_document
from lab.run import examine, held_against, model_of, rig_of, touched, truth_of
from lab.scenario import Scenario, make_scenario
from lab.simulate import simulate
from lab.studies.axes import changed
from lab.studies.collect import picked
from lab.studies.plan import Run
from lab.studies.score import Score, scored, scored_diagnosis


@dataclass(frozen=True)
class Task:
    """What all runs of a study share.

    Attributes:
        scenario: what is varied.
        folder: from where the scenario's model is seen.
        collect: names and dotted paths.
    """

    scenario: Mapping[str, Any]
    folder: str
    collect: Mapping[str, str]


class CollectError(StudyError):
    """A path of [collect] that no run can follow: the study is at fault, not the run."""


def perform(task: Task, runs: Sequence[Run]) -> list[str]:
    """The outcome of each run, one line of JSON each: its number, seed and seconds, and its score or its error."""
    return [json.dumps(_performed(task, run), allow_nan=False) for run in runs]


def _performed(task: Task, run: Run) -> dict[str, Any]:
    begun = time.perf_counter()
    outcome: dict[str, Any]
    try:
        outcome = {"score": plain(_score(task, run))}
    except CollectError:
        raise
    except Exception as error:
        # Whatever goes wrong in one run, the others go on.
        outcome = {"error": failure(error)}
    return {"run": run.number, "seed": run.seed, "seconds": time.perf_counter() - begun, **outcome}


def failure(error: BaseException) -> str:
    """An error in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _score(task: Task, run: Run) -> Score:
    table = changed(task.scenario, {**run.setting, "seed": run.seed})
    scenario = make_scenario(table, folder=Path(task.folder))
    documents, score = _tested(scenario)
    try:
        own = {name: picked(documents, path) for name, path in task.collect.items()}
    except StudyError as error:
        raise CollectError(str(error)) from None
    return {**score, "collected": own}


def _tested(scenario: Scenario) -> tuple[dict[str, Any], Score]:
    """The documents of a test, by name, and its score."""
    rig, test, chosen = rig_of(scenario), scenario.test, scenario.identification
    recording = simulate(
        rig,
        scenario.drive(),
        sample_rate=test.sample_rate,
        duration=test.duration,
        n_runs=test.runs,
        seed=scenario.seed,
        accuracy=test.accuracy,
    )
    result = examine(
        recording,
        chosen.method,
        order=chosen.order,
        dofs=touched(rig),
        refine=chosen.refine,
        **chosen.settings,
    )
    result = held_against(truth_of(scenario, rig), result, scenario)
    asked = scenario.diagnosis
    if asked is None:
        return {"result": result_document(result)}, scored(result)
    diagnosis = diagnose(recording, model_of(scenario), widths=asked.widths)
    hidden = scenario.hidden()
    judged = judge_diagnosis(diagnosis, hidden, verdict=asked.verdict, parameter_error=asked.parameter_error)
    result = replace(result, criteria=(*result.criteria, *judged))
    documents = {"result": result_document(result), "diagnosis": diagnosis_document(diagnosis)}
    right = next(criterion.passed for criterion in judged if criterion.name == "verdict_right")
    return documents, {**scored(result), **scored_diagnosis(diagnosis, hidden, right)}
