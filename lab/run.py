"""The whole flow on one page: a scenario or a recording in, a folder with data, result and pictures out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from identification.errors import RecordingError
from identification.from_responses import identify_responses
from identification.identify import Identification, identify
from identification.progress import Progress, Work
from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.compare import compare
from lab.criteria import judge
from lab.errors import RigError
from lab.files.folder import output_folder
from lab.files.model import load_model
from lab.files.recording import load
from lab.files.recording_responses import load_responses, only_responses
from lab.instruments import instrument
from lab.loads import Sampling
from lab.matching import Names, placed, read_mapping, renamed
from lab.present import present
from lab.result import Result
from lab.rig import Rig
from lab.scenario import Scenario, load_scenario
from lab.simulate import simulate_to_file
from lab.validation import validate


def run(
    scenario: Scenario | str | Path,
    out: str | Path,
    *,
    force: bool = False,
    command: str = "",
    progress: Progress | None = None,
) -> Result:
    """What a virtual test comes to: simulated, measured, identified, compared with the truth, reported.

    Args:
        scenario: the test, or the file that defines it.
        out: folder to come, with recording.h5, result.json, report.html and run.rrd; and a folder diagnosis where the
            scenario asks for one.
        force: replace an earlier output there.
        command: how the test was called, for the report.
        progress: told what is being done, and the share of it that is done: of the simulation, then of the analysis.

    Raises:
        LabError, IdentificationError: something in the scenario is wrong, or the folder cannot be written.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    with output_folder(out, force=force) as folder:
        rig = rig_of(scenario)
        _record(folder / "recording.h5", rig, scenario, Work(progress).called("simulating"))
        recording = load(folder / "recording.h5")
        chosen = scenario.identification
        result = examine(
            recording,
            chosen.method,
            order=chosen.order,
            dofs=touched(rig),
            refine=chosen.refine,
            progress=progress,
            **chosen.settings,
        )
        result = replace(held_against(truth_of(scenario, rig), result, scenario), title=scenario.title)
        result = _validated(result, recording, scenario)
        if scenario.diagnosis is not None:
            result = _diagnosed(
                folder / "diagnosis", result, recording, scenario, command=command, progress=progress
            )
        writing = Work(progress).called("writing the report")
        present(folder, result, recording, scenario=scenario, rig=rig, command=command, work=writing)
    return result


def identify_file(
    path: str | Path,
    out: str | Path,
    *,
    method: str | None = None,
    order: int | None = None,
    refine: bool = False,
    model: str | Path | None = None,
    mapping: str | Path | Names | None = None,
    force: bool = False,
    command: str = "",
    progress: Progress | None = None,
    **settings: Any,
) -> Result:
    """What a recording file tells by itself: modes, and M, C, K where the set-up allows.

    Args:
        path: recording file; where it holds no samples, its frequency responses are taken.
        out: folder to come, with result.json, report.html and run.rrd.
        method: name, as in `lab list methods`; chosen from the data when None.
        order: number of states; chosen from the data when None.
        refine: move modes and matrices to the maximum of the likelihood; needs measured forces, or free decays.
        model: file or name of a model that says which degree of freedom each channel drives or reads, and in whose shape
            modes are shown in motion; nothing of its numbers is used.
        mapping: file that renames channels as the model has them, or the names themselves (see `lab.matching`).
        force: replace an earlier output there.
        command: how the lab was called, for the report.
        progress: told what is being done, and the share of it that is done.
        settings: further settings of the method.

    Raises:
        LabError, IdentificationError: the file or the request is wrong, or the folder cannot be written.
    """
    with output_folder(out, force=force) as folder:
        data: Recording | FrequencyResponse
        names = read_mapping(mapping) if isinstance(mapping, str | Path) else mapping or {}
        rig = None if model is None else load_model(model)
        if only_responses(path):
            if refine:
                raise RecordingError(f"{path} holds frequency responses alone; to refine, samples are needed")
            data = renamed(load_responses(path), names)
            data = data if rig is None else placed(data, rig)
            Work(progress).called("identifying")
            result = examine_responses(data, method, order=order, **settings)
        else:
            data = renamed(load(path), names)
            data = data if rig is None else placed(data, rig)
            result = examine(data, method, order=order, refine=refine, progress=progress, **settings)
        writing = Work(progress).called("writing the report")
        present(folder, result, data, command=command, rig=rig, source=path, work=writing)
    return result


def rig_of(scenario: Scenario) -> Rig:
    """The rig that a scenario describes: its effects hidden, its instruments on and its channels connected."""
    rig = model_of(scenario)
    for effect in scenario.hidden():
        rig = effect.apply(rig)
    instruments = {name: value for name, value in scenario.instruments if value is not None}
    return instrument(rig, **instruments, sample_rate=scenario.test.sample_rate) if instruments else rig


def model_of(scenario: Scenario) -> Rig:
    """The model as its file says, with the channels of the scenario connected."""
    path = scenario.model_file()
    try:
        rig = Rig.load(path)
    except RigError as error:
        raise RigError(f"{error} (in {path})") from None
    wanted = scenario.channels
    # An axis across all motion would only record rounding errors.
    outputs = rig.responding if wanted.outputs is None else wanted.outputs
    return rig.connected(inputs=wanted.inputs, outputs=outputs)


def truth_of(scenario: Scenario, rig: Rig) -> Rig:
    """The rig whose modes and matrices count as true: the one that was simulated, unless an effect bent a linear model."""
    if not scenario.effects:
        return rig
    model = model_of(scenario)
    return model if model.linear and not rig.linear else rig


def touched(rig: Rig) -> list[str]:
    """Degrees of freedom that a channel reads or drives, in model order."""
    named = {channel.dof for channel in (*rig.inputs, *rig.outputs)}
    return [dof for dof in rig.dofs if dof in named]


def examine(
    recording: Recording,
    method: str | None = None,
    *,
    order: int | None = None,
    dofs: Sequence[str] | None = None,
    refine: bool = False,
    progress: Progress | None = None,
    **settings: Any,
) -> Result:
    """The result of identifying a recording, without any truth beside it.

    Args:
        recording: complete, in SI units.
        method: name, as in `lab list methods`; chosen from the data when None.
        order: number of states; chosen from the data when None.
        dofs: names of the degrees of freedom of M, C, K, in the order wanted.
        refine: move modes and matrices to the maximum of the likelihood; needs measured forces, or free decays.
        progress: as for `identify`.
        settings: further settings of the method.

    Raises:
        IdentificationError: the recording or the request is at fault.
    """
    found = identify(recording, method, order=order, dofs=dofs, refine=refine, progress=progress, **settings)
    return _result(found, recording.title, recording.sample_rate)


def examine_responses(
    response: FrequencyResponse,
    method: str | None = None,
    *,
    order: int | None = None,
    dofs: Sequence[str] | None = None,
    **settings: Any,
) -> Result:
    """The result of identifying frequency responses; its sample rate is infinite where they are continuous in time.

    Args:
        response: in SI units.
        method: as for `identify_responses`.
        order: number of states; chosen from the data when None.
        dofs: names of the degrees of freedom of M, C, K, in the order wanted.
        settings: further settings of the method.

    Raises:
        IdentificationError: the responses or the request are at fault.
    """
    found = identify_responses(response, method, order=order, dofs=dofs, **settings)
    return _result(found, "", 1 / response.dt if response.dt else float("inf"))


def _result(found: Identification, title: str, sample_rate: float) -> Result:
    return Result(
        title=title,
        sample_rate=sample_rate,
        modes=found.modes.normalized(),
        stable=tuple(found.stable),
        second_order=found.second_order,
        realization=found.realization,
        stabilization=found.stabilization,
        warnings=tuple(found.warnings),
        notes=tuple(found.notes),
        explanation=found.explanation,
        refinement=None if found.refinement is None else found.refinement.estimate,
    )


def held_against(rig: Rig, result: Result, scenario: Scenario) -> Result:
    """The result with the rig's truth beside it, and the scenario's criteria judged."""
    truth, matrices = rig.modes().normalized(), rig.second_order()
    comparison = compare(truth, result.modes, matrices, result.second_order)
    return replace(
        result,
        truth_modes=truth,
        truth_second_order=matrices,
        comparison=comparison,
        criteria=judge(scenario.criteria.model_dump(), comparison),
    )


def _validated(result: Result, recording: Recording, scenario: Scenario) -> Result:
    """The result with the criteria of the field judged."""
    told = recording.attributes.get("simulation_error", 0.0)
    numerical = 0.0 if isinstance(told, str) else float(told)
    limits = scenario.validation.limits()
    return replace(result, validation=validate(result, limits, numerical_error=numerical))


def _diagnosed(
    folder: Path,
    result: Result,
    recording: Recording,
    scenario: Scenario,
    *,
    command: str,
    progress: Progress | None,
) -> Result:
    """The result with the diagnosis judged; the folder holds what `lab diagnose` writes."""
    # Imported here because few scenarios are diagnosed, and the search for causes is slow to load.
    from lab.diagnose_files import present_diagnosis
    from lab.diagnosis.diagnose import diagnose
    from lab.diagnosis.judge import judge_diagnosis
    from lab.show.findings import verdict_of

    asked = scenario.diagnosis
    assert asked is not None
    # Titled before, so that the report names the test.
    recording = replace(recording, title=scenario.title)
    diagnosis = diagnose(recording, model_of(scenario), widths=asked.widths, progress=progress)
    recording = recording.select(outputs=[channel.name for channel in diagnosis.nominal.outputs])
    folder.mkdir()
    facts = {
        "Scenario": f"{scenario.title}; word for word in report.html of the folder above",
        "Model": scenario.model,
        "Seed": str(scenario.seed),
    }
    present_diagnosis(folder, diagnosis, recording, command=command, facts=facts)
    judged = judge_diagnosis(
        diagnosis, scenario.hidden(), verdict=asked.verdict, parameter_error=asked.parameter_error
    )
    said = f"Diagnosis, in the folder diagnosis: {verdict_of(diagnosis, recording).sentence}"
    return replace(
        result,
        criteria=(*result.criteria, *judged),
        notes=(*result.notes, said),
        explanation=f"{result.explanation} {said}".strip(),
    )


def _record(path: Path, rig: Rig, scenario: Scenario, work: Work) -> None:
    drive, test, simulated = scenario.drive(), scenario.test, 0

    @cache
    def total() -> int:
        sampling = Sampling(test.sample_rate, round(test.duration * test.sample_rate))
        one_run = drive.loads(rig, sampling, np.random.default_rng(scenario.seed))
        return test.runs * sum(load.n_samples for load in one_run)

    def count(n: int) -> None:
        nonlocal simulated
        simulated += n
        work.done(simulated / total())

    simulate_to_file(
        path,
        rig,
        drive,
        sample_rate=test.sample_rate,
        duration=test.duration,
        n_runs=test.runs,
        seed=scenario.seed,
        accuracy=test.accuracy,
        progress=None if work.listener is None else count,
    )
