"""A recipe: which column of a foreign file is which channel, read strictly from a TOML file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, NonNegativeInt, PositiveFloat, PrivateAttr, ValidationError, model_validator

from lab.errors import FileError, StudyError
from lab.files.recipe_parts import (
    ArraysPart,
    BlocksPart,
    ChannelPart,
    Column,
    FrequencyPart,
    Kind,
    Part,
    Range,
    RecordPart,
    ResponsePart,
    TablePart,
)


class Recipe(Part):
    """What a foreign file means.

    Attributes:
        title, source: free text that goes into the recording.
        kind: what drove the structure.
        sample_rate: [Hz], or the name of a single number in the file.
        time: column of time, checked to be even; gives the rate where none is stated.
        time_unit: of that column.
        record: column that changes where a new record begins.
        inputs, outputs: the channels.
        drop_first, drop_last: samples left out at the ends of every record.
        missing: ranges of samples of the whole that are marked as missing.
        records: stretches that become records of their own.
        table, arrays, blocks: how the file is written.
        frequency, responses: frequency responses, instead of samples.
        uff_units: what to believe where labels and unit system of a universal file disagree.
        length_unit: of the geometry in a universal file that states none.
    """

    title: str = ""
    source: str = ""
    kind: Kind | None = None
    sample_rate: PositiveFloat | str | None = None
    time: Column | None = None
    time_unit: Literal["s", "ms", "us", "min"] = "s"
    record: Column | None = None
    inputs: list[ChannelPart] = Field(default_factory=list)
    outputs: list[ChannelPart] = Field(default_factory=list)
    drop_first: NonNegativeInt = 0
    drop_last: NonNegativeInt = 0
    missing: list[Range] = Field(default_factory=list)
    records: list[RecordPart] = Field(default_factory=list)
    table: TablePart = TablePart()
    arrays: ArraysPart = ArraysPart()
    blocks: BlocksPart | None = None
    frequency: FrequencyPart | None = None
    responses: list[ResponsePart] = Field(default_factory=list)
    uff_units: Literal["labels", "dataset 164"] | None = None
    length_unit: str | None = None
    _text: str = PrivateAttr(default="")

    @model_validator(mode="after")
    def _consistent(self) -> Recipe:
        if bool(self.responses) != (self.frequency is not None):
            raise ValueError("[frequency] and [[responses]] belong together; give both or neither")
        if self.records and (self.record is not None or (self.blocks and self.blocks.stack == "records")):
            raise ValueError("[[records]] cannot be combined with record = … or with one record per file")
        return self

    @property
    def text(self) -> str:
        """The file as written, empty for a recipe made in Python."""
        return self._text


def load_recipe(path: str | Path) -> Recipe:
    """The recipe in a TOML file.

    Raises:
        FileError: the file cannot be read.
        StudyError: not TOML, an unknown or missing key, an impossible value.
    """
    path = Path(path)
    try:
        return parse_recipe(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror}); expected a recipe (TOML)") from None
    except UnicodeDecodeError:
        raise FileError(f"{path}: is not text; expected a recipe (TOML)") from None
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None


def parse_recipe(text: str) -> Recipe:
    """The recipe in a text of TOML.

    Raises:
        StudyError: not TOML, an unknown or missing key, an impossible value.
    """
    try:
        recipe = Recipe.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"is not TOML ({error})") from None
    except ValidationError as error:
        raise StudyError(_explain(error)) from None
    recipe._text = text
    return recipe


def _explain(error: ValidationError) -> str:
    """The first complaint in one line: which key, where, what is allowed."""
    # A misspelt key may also be a missing one: the misspelling is the better news.
    rank = {"extra_forbidden": 0, "string_type": 2}
    first = min(error.errors(include_url=False), key=lambda each: rank.get(each["type"], 1))
    message = first["msg"].removeprefix("Value error, ")
    names = [str(part) for part in first["loc"] if isinstance(part, str) and part[:1].islower()]
    if first["type"] == "value_error":
        return message
    # A union adds the name of the type that it tried.
    names = [name for name in names if name not in ("str", "int", "float") and "constrained" not in name]
    key, tables = names[-1], names[:-1]
    where = f"in [{'.'.join(tables)}]" if tables else "at the top"
    if first["type"] == "extra_forbidden":
        return f"unknown key {key!r} {where}; allowed are {', '.join(_keys(tables))}"
    if first["type"] == "missing":
        return f"key {key!r} is missing {where}"
    return f"{key} = {first['input']!r} {where}: {message[:1].lower()}{message[1:]}"


_PARTS: dict[str, type[Part]] = {
    "inputs": ChannelPart,
    "outputs": ChannelPart,
    "records": RecordPart,
    "table": TablePart,
    "arrays": ArraysPart,
    "blocks": BlocksPart,
    "frequency": FrequencyPart,
    "responses": ResponsePart,
}


def _keys(tables: list[str]) -> list[str]:
    model: Any = _PARTS[tables[0]] if tables else Recipe
    return list(model.model_fields)
