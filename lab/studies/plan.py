"""A study: everything that defines it, read strictly from a TOML file, and its runs by number."""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, PositiveInt, ValidationError

from lab.errors import FileError, StudyError
from lab.scenario import Scenario, Table, explain, load_scenario, make_scenario
from lab.studies.axes import Axis, axes_of, changed
from lab.studies.collect import check_collected

MAX_TRIED = 1000
"""Values of an axis that are tried before the study starts."""


class Run(NamedTuple):
    """One run of a study: its number, what it changes in the scenario, and its seed."""

    number: int
    setting: dict[str, Any]
    seed: int


class StudyFile(Table):
    """What a study file says.

    Attributes:
        title: what is asked, in one line.
        scenario: file, seen from the study file, or a name in the catalogue.
        seed: of all seeds of the runs.
        repeats: runs of each setting, with different seeds.
        paired: the settings share their seeds, so that differences between them are not those of the noise.
        vary: dotted keys of the scenario with lists or ranges: every combination of them in one table [vary]; in each
            table of several, [[vary]], the keys step together.
        collect: names, and dotted paths into result.json or diagnosis.json, such as result.modes.0.frequency_hz.
    """

    title: str
    scenario: str
    seed: Annotated[int, Field(ge=0)] = 0
    repeats: PositiveInt = 1
    paired: bool = False
    vary: dict[str, Any] | list[dict[str, Any]] = Field(default_factory=dict)
    collect: dict[str, str] = Field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Study:
    """Many runs of a scenario.

    Attributes:
        title: what is asked, in one line.
        scenario: what is varied, as in its file.
        folder: from where the scenario's model is seen.
        axes: what varies.
        repeats, seed, paired, collect: as in `StudyFile`.
        text, scenario_text: the files as written.
    """

    title: str
    scenario: Mapping[str, Any]
    folder: Path
    axes: tuple[Axis, ...]
    repeats: int = 1
    seed: int = 0
    paired: bool = False
    collect: Mapping[str, str] = field(default_factory=dict)
    text: str = ""
    scenario_text: str = ""

    @property
    def n_points(self) -> int:
        """Number of settings."""
        return math.prod(len(axis) for axis in self.axes)

    @property
    def n_runs(self) -> int:
        """Number of settings times repeats."""
        return self.n_points * self.repeats

    def setting(self, point: int) -> dict[str, Any]:
        """What a point of the study changes in the scenario; the last axis steps fastest."""
        steps = np.unravel_index(point, [len(axis) for axis in self.axes]) if self.axes else ()
        return {
            path: value
            for axis, step in zip(self.axes, steps, strict=True)
            for path, value in axis.setting(int(step)).items()
        }

    def run(self, number: int) -> Run:
        """A run by its number; every point has its first run before any has its second."""
        repeat, point = divmod(number, self.n_points)
        setting = self.setting(point)
        # The seed depends on what is run alone, so neither workers nor later extensions change it.
        place = () if self.paired else _words(setting)
        source = np.random.SeedSequence(self.seed, spawn_key=(*place, repeat))
        # TOML holds 63 bits.
        seed = int(source.generate_state(1, np.uint64)[0] >> np.uint64(1))
        return Run(number, setting, setting.get("seed", seed))


def load_study(path: str | Path) -> Study:
    """The study in a TOML file.

    Raises:
        FileError: the file or its scenario cannot be read.
        UnknownNameError: the scenario is neither a file nor a name in the catalogue.
        StudyError: not TOML, an unknown or missing key, an impossible value.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror}); expected a study file (TOML)") from None
    except UnicodeDecodeError:
        raise FileError(f"{path}: is not text; expected a study file (TOML)") from None
    try:
        written = StudyFile.model_validate(tomllib.loads(text))
        beside = path.parent / written.scenario
        scenario = load_scenario(beside if beside.is_file() else written.scenario)
        return _study(written, text, scenario)
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{path}: is not TOML ({error})") from None
    except ValidationError as error:
        raise StudyError(f"{path}: {explain(error, model=StudyFile)}") from None
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None


def _study(written: StudyFile, text: str, scenario: Scenario) -> Study:
    study = Study(
        title=written.title,
        scenario=tomllib.loads(scenario.text),
        folder=scenario.folder.resolve(),
        axes=axes_of(written.vary),
        repeats=written.repeats,
        seed=written.seed,
        paired=written.paired,
        collect=written.collect,
        text=text,
        scenario_text=scenario.text,
    )
    _check(study)
    return study


def _check(study: Study) -> None:
    """Refuses values that the scenario refuses; each is tried beside the first values of the other axes."""
    check_collected(study.collect)
    first = study.setting(0)
    if "seed" in first and study.repeats > 1:
        raise StudyError(
            f"repeats = {study.repeats} with 'seed' in [vary]; each run has one seed, leave one of both out"
        )
    for axis in study.axes:
        # A longer axis is a range in all likelihood, and good where its ends are good.
        for step in np.unique(np.linspace(0, len(axis) - 1, MAX_TRIED, dtype=int)).tolist():
            setting = axis.setting(step)
            try:
                make_scenario(changed(study.scenario, {**first, **setting}), folder=study.folder).model_file()
            except StudyError as error:
                told = ", ".join(f"{path} = {json.dumps(value)}" for path, value in setting.items())
                raise StudyError(f"{error} (with {told} of [vary])") from None


def _words(setting: Mapping[str, Any]) -> tuple[int, ...]:
    """A setting as four numbers of 32 bits that no other setting shares."""
    text = json.dumps(setting, sort_keys=True, default=str)
    return tuple(np.frombuffer(hashlib.sha256(text.encode()).digest()[:16], dtype="<u4").tolist())
