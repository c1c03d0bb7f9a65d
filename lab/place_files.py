"""A model file in, a folder with the placement out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from identification.progress import UNHEARD, Progress, Work
from identification.recording import Array
from lab.errors import LabError
from lab.files.folder import output_folder
from lab.files.model import load_model
from lab.files.placement import save_placement
from lab.placement.outcome import Placement
from lab.placement.place import place
from lab.placement.plan import Plan, usual_plan
from lab.placement.shapes import normal_modes
from lab.rig import Rig
from lab.scenario import Scenario, load_scenario


def place_file(
    model: str | Path | None,
    out: str | Path,
    n_sensors: int,
    *,
    scenario: str | Path | None = None,
    test: Mapping[str, Any] | None = None,
    force: bool = False,
    command: str = "",
    progress: Progress | None = None,
    **settings: Any,
) -> tuple[Placement, Rig]:
    """Where sensors and actuators of a model should go: found, written, shown.

    Args:
        model: model file, or a name from the catalogue; that of the scenario when None.
        out: folder to come, with placement.json, report.html and run.rrd.
        n_sensors: how many sensors.
        scenario: scenario file, or a name from the catalogue, of the test that is planned: its layout is ranked too.
        test: excitation, level, sample_rate, duration, noise_percent and seed of the test, where they differ.
        force: replace an earlier output there.
        command: how the lab was called, for the report.
        progress: told what is being done, and the share of it that is done.
        settings: as for `lab.placement.place.place`.

    Returns:
        The placement, and the rig with all candidates connected.

    Raises:
        LabError, IdentificationError: the model, the test and the numbers do not go together, or the folder cannot be
            written.
    """
    with output_folder(out, force=force) as folder:
        planned_test = None if scenario is None else load_scenario(scenario)
        rig = _rig(model, planned_test)
        plan = _plan(_frequencies(rig, n_sensors, settings), planned_test, dict(test or {}))
        if planned_test is not None:
            settings = {**settings, "planned": _layout(planned_test)}
        placement = place(rig, n_sensors, plan=plan, progress=progress, **settings)
        facts = {
            name: str(value)
            for name, value in (("Model", model), ("Scenario", scenario))
            if value is not None
        }
        writing = Work(progress).called("writing the report")
        present_placement(folder, placement, rig, command=command, facts=facts, work=writing)
    return placement, rig


def present_placement(
    folder: Path,
    placement: Placement,
    rig: Rig,
    *,
    command: str = "",
    facts: Mapping[str, str] | None = None,
    work: Work = UNHEARD,
) -> None:
    """Writes placement.json, report.html and run.rrd into a folder, telling `work`; all else as for `place_file`."""
    # Imported here because drawing is slow to load and `lab` must come up without it.
    from lab.show.placement_report import write_placement_report
    from lab.show.rerun_log.placement import write_placement_rrd

    save_placement(placement, folder / "placement.json")
    loading, reporting, _ = work.parts(1.5, 1.0, 0.5)
    loading.done()
    write_placement_report(folder / "report.html", placement, rig, command=command, facts=facts)
    reporting.done()
    write_placement_rrd(folder / "run.rrd", placement, rig)


def _rig(model: str | Path | None, scenario: Scenario | None) -> Rig:
    if model is None:
        if scenario is None:
            raise LabError("neither a model nor a scenario is given; give --model MODEL.xml")
        model = scenario.model_file()
    return load_model(model)


def _frequencies(rig: Rig, n_sensors: int, settings: Mapping[str, Any]) -> Array:
    """Natural frequencies that the test must cover [Hz]: for modes, those asked for."""
    if settings.get("target", "modes") == "modes":
        n_channels = n_sensors * (3 if settings.get("triaxial") else 1)
        return np.asarray(normal_modes(rig)[0][: settings.get("n_modes", n_channels)] / (2 * np.pi))
    return rig.second_order().modes().frequency_hz


def _plan(frequency_hz: Array, scenario: Scenario | None, test: dict[str, Any]) -> Plan:
    """The test: that of the scenario, or one that suits the structure, with what is said differently."""
    given = {name: value for name, value in test.items() if value is not None}
    own: dict[str, Any] = {}
    if scenario is not None:
        own = {
            "sample_rate": scenario.test.sample_rate,
            "duration": scenario.test.duration,
            "seed": scenario.seed,
        }
        if scenario.instruments.noise_percent:
            own["noise_percent"] = scenario.instruments.noise_percent
    plan = usual_plan(frequency_hz, **{**own, **given})
    if scenario is not None and "excitation" not in given and "level" not in given:
        plan = plan.driven(scenario.drive())
    return plan


def _layout(scenario: Scenario) -> tuple[list[str], list[str]] | None:
    """Channels of the scenario, where it names both sides."""
    if scenario.channels.inputs is None or scenario.channels.outputs is None:
        return None
    return list(scenario.channels.outputs), list(scenario.channels.inputs)
