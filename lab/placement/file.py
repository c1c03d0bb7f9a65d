"""A placement file: everything that `lab place` is asked, read strictly from a TOML file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt, ValidationError

from lab.errors import FileError, StudyError
from lab.scenario import Table, explain


class PlacementFile(Table):
    """What a placement file says; whatever is left out is as for the command.

    Attributes:
        title: what is asked, in one line.
        scenario: the test that is planned: a file, seen from this one, or a name in the catalogue.
        model: MJCF file, seen from this file, or a name in the catalogue; that of the scenario when left out.
        sensors, actuators: how many.
        target: what the test is for.
        fixed, forbid, quantity, triaxial, criterion, modes, setups, references, sensor_mass, size, effects, noise,
            noise_percent, excitation, level, sample_rate, duration, seed: as the options of the command.
    """

    title: str
    scenario: str | None = None
    model: str | None = None
    sensors: PositiveInt
    actuators: NonNegativeInt = 0
    target: Literal["modes", "matrices", "diagnosis"] = "modes"
    fixed: list[str] = Field(default_factory=list)
    forbid: list[str] = Field(default_factory=list)
    quantity: str | None = None
    triaxial: bool = False
    criterion: str | None = None
    modes: PositiveInt | None = None
    setups: PositiveInt | None = None
    references: PositiveInt | None = None
    sensor_mass: PositiveFloat | None = None
    size: PositiveFloat | None = None
    effects: list[str] = Field(default_factory=list)
    noise: dict[str, PositiveFloat] = Field(default_factory=dict)
    noise_percent: PositiveFloat | None = None
    excitation: str | None = None
    level: PositiveFloat | None = None
    sample_rate: PositiveFloat | None = None
    duration: PositiveFloat | None = None
    seed: Annotated[int, Field(ge=0)] | None = None


NAMES = {"sensors": "n_sensors", "actuators": "n_actuators", "modes": "n_modes", "effects": "causes"}
"""Keys whose options have other names in Python."""


def load_placement_file(path: str | Path) -> dict[str, Any]:
    """What a placement file asks, by the names of the options of the command.

    Raises:
        FileError: the file cannot be read.
        StudyError: not TOML, an unknown or missing key, an impossible value.
    """
    path = Path(path)
    try:
        written = PlacementFile.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise FileError(
            f"{path}: cannot be read ({error.strerror}); expected a placement file (TOML)"
        ) from None
    except UnicodeDecodeError:
        raise FileError(f"{path}: is not text; expected a placement file (TOML)") from None
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{path}: is not TOML ({error})") from None
    except ValidationError as error:
        raise StudyError(f"{path}: {explain(error, model=PlacementFile)}") from None
    asked = written.model_dump(exclude_unset=True, exclude={"title"})
    for key in {"scenario", "model"} & set(asked):
        beside = path.parent / asked[key]
        asked[key] = str(beside) if beside.is_file() else asked[key]
    if "noise" in asked:
        asked["noise"] = [f"{unit}={std!r}" for unit, std in asked["noise"].items()]
    return {NAMES.get(key, key): value for key, value in asked.items()}
