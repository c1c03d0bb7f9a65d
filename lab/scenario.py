"""A scenario: everything that defines one virtual test, read strictly from a TOML file."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PositiveFloat,
    PositiveInt,
    PrivateAttr,
    TypeAdapter,
    ValidationError,
)

from lab import catalogue
from lab.effects import EFFECTS
from lab.effects.effect import Effect
from lab.errors import FileError, StudyError
from lab.excitation import EXCITATIONS, Excitation
from lab.validation import Limits

Fraction = Annotated[float, Field(ge=0, le=1)]
Bound = Annotated[float, Field(ge=0)]
Choice = str | dict[str, Any]


class Table(BaseModel):
    """A table of the file: unknown keys, numbers written as text and infinities are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Schedule(Table):
    """How the test is run.

    Attributes:
        sample_rate: [Hz].
        duration: of each record [s].
        runs: how often the test is repeated; with pulses, impacts and sweeps, a run is one record per input.
        accuracy: largest relative error of the simulation; chosen from the instruments when left out.
    """

    sample_rate: PositiveFloat
    duration: PositiveFloat
    runs: PositiveInt = 1
    accuracy: PositiveFloat | None = None


class Channels(Table):
    """Which actuators and sensors are connected, by name; when left out, all that the structure can move."""

    inputs: list[str] | None = None
    outputs: list[str] | None = None


class Instruments(Table):
    """What measures; ideal where left out.

    Attributes:
        noise_percent: white noise on every output, in percent of its RMS.
        accelerometer, velocity_sensor, displacement_sensor, force_sensor, shaker, acquisition: name of a preset, or a
            table of settings that may start from one (preset = "…").
    """

    noise_percent: Bound | None = None
    accelerometer: Choice | None = None
    velocity_sensor: Choice | None = None
    displacement_sensor: Choice | None = None
    force_sensor: Choice | None = None
    shaker: Choice | None = None
    acquisition: Choice | None = None


class Identification(Table):
    """How the recording is identified; chosen from the data where left out.

    Attributes:
        method: name, as in `lab list methods`.
        order: number of states.
        settings: further settings of the method, by name.
        refine: move modes and matrices to the maximum of the likelihood; needs measured forces, or free decays.
    """

    method: str | None = None
    order: PositiveInt | None = None
    settings: dict[str, Any] = {}
    refine: bool = False


class Diagnosing(Table):
    """The recording is also diagnosed, with the model as its file says; the effects hidden are what it must find.

    Attributes:
        widths: relative tolerance of the model's parameters, by group ("mass", "stiffness", "damping") or by name.
        verdict: what it must come to; when left out, explained with hidden effects and consistent without.
        parameter_error: largest error of a parameter found, in its own standard deviations.
    """

    widths: dict[str, PositiveFloat] = {}
    verdict: Literal["consistent", "explained", "unexplained"] | None = None
    parameter_error: PositiveFloat = 4.0


class Criteria(Table):
    """What the test must reach.

    Attributes:
        modes: at least so many modes of the structure found.
        frequency_error, damping_ratio_error: largest relative error over the paired modes.
        mac: smallest modal assurance criterion over the paired modes.
        mass_error, damping_error, stiffness_error: largest entry error over largest entry of the matrix.
    """

    modes: PositiveInt | None = None
    frequency_error: Bound | None = None
    damping_ratio_error: Bound | None = None
    mac: Fraction | None = None
    mass_error: Bound | None = None
    damping_error: Bound | None = None
    stiffness_error: Bound | None = None


class Validating(Table):
    """Limits of the criteria of the field, which the report judges whatever the scenario requires.

    Attributes:
        first_frequency_error, frequency_error: largest relative error of the lowest mode, and of the others.
        mac: smallest modal assurance criterion of a pair of modes.
        cross_orthogonality, cross_orthogonality_off: smallest entry of a mode with its partner, largest with another.
    """

    first_frequency_error: Bound = Limits.first_frequency_error
    frequency_error: Bound = Limits.frequency_error
    mac: Fraction = Limits.mac
    cross_orthogonality: Fraction = Limits.cross_orthogonality
    cross_orthogonality_off: Fraction = Limits.cross_orthogonality_off

    def limits(self) -> Limits:
        """The same as the judge takes them."""
        return Limits(**self.model_dump())


class Scenario(Table):
    """A whole virtual test.

    Attributes:
        title: what is tested, in one line.
        model: MJCF file, seen from the scenario file, or a name in the catalogue.
        seed: of everything random.
        test: how the test is run.
        excitation: its kind, as in `EXCITATIONS`, and its settings.
        effects: what is wrong with the real structure or its instruments: a list of tables with cause, location and
            parameters, as in `lab list effects`; the model knows nothing of it.
        channels: which actuators and sensors are connected.
        instruments: what measures.
        identification: how the recording is identified.
        diagnosis: what a diagnosis of the recording must find; none is made when left out.
        criteria: what the test must reach.
        validation: limits of the criteria of the field.
    """

    title: str
    model: str
    seed: Annotated[int, Field(ge=0)] = 0
    test: Schedule
    excitation: dict[str, Any]
    effects: list[dict[str, Any]] = []
    channels: Channels = Channels()
    instruments: Instruments = Instruments()
    identification: Identification = Identification()
    diagnosis: Diagnosing | None = None
    criteria: Criteria = Criteria()
    validation: Validating = Validating()
    _folder: Path = PrivateAttr(default=Path())
    _text: str = PrivateAttr(default="")

    @property
    def text(self) -> str:
        """The file as written, empty for a scenario made in Python."""
        return self._text

    @property
    def folder(self) -> Path:
        """From where the model file is seen."""
        return self._folder

    def model_file(self) -> Path:
        """Where the model lies.

        Raises:
            UnknownNameError: neither a file nor a name in the catalogue.
        """
        beside = self._folder / self.model
        return beside if beside.is_file() else catalogue.find("models", self.model)

    def changed(
        self, *, seed: int | None = None, method: str | None = None, order: int | None = None
    ) -> Scenario:
        """The scenario with another seed, method or order where one is given; a new method starts afresh."""
        update: dict[str, Any] = {} if seed is None else {"seed": seed}
        chosen = self.identification
        if method is not None and method != chosen.method:
            chosen = Identification(method=method, refine=chosen.refine)
        if order is not None:
            chosen = chosen.model_copy(update={"order": order})
        return self.model_copy(update={**update, "identification": chosen})

    def drive(self) -> Excitation:
        """The excitation.

        Raises:
            StudyError: unknown kind or setting, or an impossible value.
        """
        excitation: Excitation = _chosen(self.excitation, "excitation", "kind", EXCITATIONS)
        return excitation

    def hidden(self) -> tuple[Effect, ...]:
        """The effects, in the order in which they come about.

        Raises:
            StudyError: unknown cause or parameter, or an impossible value.
        """
        return tuple(_chosen(table, "effects", "cause", EFFECTS) for table in self.effects)


def load_scenario(path: str | Path) -> Scenario:
    """The scenario in a TOML file, or of that name in the catalogue.

    Raises:
        FileError: the file cannot be read.
        UnknownNameError: neither a file nor a name in the catalogue.
        StudyError: not TOML, an unknown or missing key, an impossible value.
    """
    path = Path(path)
    if not path.exists() and path.name == str(path):
        path = catalogue.find("scenarios", str(path))
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise FileError(
            f"{path}: cannot be read ({error.strerror}); expected a scenario file (TOML)"
        ) from None
    except UnicodeDecodeError:
        raise FileError(f"{path}: is not text; expected a scenario file (TOML)") from None
    try:
        return make_scenario(tomllib.loads(text), folder=path.parent, text=text)
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{path}: is not TOML ({error})") from None
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None


def make_scenario(table: Mapping[str, Any], *, folder: Path = Path(), text: str = "") -> Scenario:
    """The scenario that a table describes.

    Args:
        table: as in a scenario file.
        folder: from where its model file is seen.
        text: the file as written.

    Raises:
        StudyError: an unknown or missing key, or an impossible value.
    """
    try:
        scenario = Scenario.model_validate(table)
    except ValidationError as error:
        raise StudyError(explain(error)) from None
    scenario._folder, scenario._text = folder, text
    scenario.drive()
    scenario.hidden()
    return scenario


def _chosen(table: Mapping[str, Any], name: str, key: str, known: Mapping[str, type]) -> Any:
    """The object that a table describes: its class under `key`, and the fields of that class."""
    settings = dict(table)
    kind = settings.pop(key, None)
    if kind is None:
        raise StudyError(f"key {key!r} is missing {_place(name)}")
    if kind not in known:
        raise StudyError(f"{key} = {kind!r} {_place(name)}; expected one of {', '.join(known)}")
    allowed = [field.name for field in dataclasses.fields(known[kind])]
    unknown = [setting for setting in settings if setting not in allowed]
    if unknown:
        raise StudyError(_unknown_key(unknown[0], name, [key, *allowed]))
    # As JSON, a list may stand for a tuple while text still does not stand for a number.
    text = json.dumps(settings, default=str)
    try:
        return _adapter(known[kind]).validate_json(text, strict=True)
    except ValidationError as error:
        raise StudyError(explain(error, name)) from None


@cache
def _adapter(kind: type) -> TypeAdapter[Any]:
    """Built once for each class, which takes longer than many a check."""
    return TypeAdapter(kind)


def explain(error: ValidationError, *inside: str, model: type[BaseModel] = Scenario) -> str:
    """The first complaint in one line: which key, where, what is allowed; `model` is that of the whole file."""
    # A misspelt key is also a missing one: the misspelling is the better news.
    first = min(error.errors(include_url=False), key=lambda each: each["type"] != "extra_forbidden")
    *tables, key = (*inside, *(part for part in first["loc"] if isinstance(part, str)))
    key += "".join(f"[{part}]" for part in first["loc"] if isinstance(part, int))
    if first["type"] == "extra_forbidden":
        return _unknown_key(key, ".".join(tables), _keys(tables, model))
    where = _place(".".join(tables))
    if first["type"] == "missing":
        return f"key {key!r} is missing {where}"
    return f"{key} = {first['input']!r} {where}: {first['msg'][:1].lower()}{first['msg'][1:]}"


def _unknown_key(key: str, table: str, allowed: list[str]) -> str:
    return f"unknown key {key!r} {_place(table)}; allowed are {', '.join(allowed)}"


def _place(table: str) -> str:
    return f"in [{table}]" if table else "at the top"


def _keys(tables: list[str], model: type[BaseModel]) -> list[str]:
    for table in tables:
        annotation = model.model_fields[table].annotation
        model = next(kind for kind in (annotation, *get_args(annotation)) if isinstance(kind, type))
    return list(model.model_fields)
