"""The tables of a recipe, each read strictly."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    model_validator,
)

from identification.recording import KINDS
from identification.response import SCALES

Column = str | Annotated[int, Field(ge=1)]
"""A column by its name, or by its number from 1."""

Kind = Literal[
    "pulse", "impact", "random", "burst_random", "sweep", "multisine", "ambient", "free_decay", "other"
]
assert get_args(Kind) == KINDS

Range = Annotated[list[NonNegativeInt], Field(min_length=2, max_length=2)]
"""First sample, counted from 0, and the one after the last."""


class Part(BaseModel):
    """A table of the file: unknown keys, numbers written as text and infinities are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class ChannelPart(Part):
    """One channel: value = sign · factor · (reading - offset) / sensitivity, in `unit`.

    Attributes:
        name: of the channel.
        column: where its readings are; the column called like the channel when left out.
        unit: of the value, such as "N", "g", "mm"; what the file states when left out.
        factor: values per reading.
        sensitivity: readings per value, as printed on a sensor (560 counts per centimetre).
        sign: -1 turns a channel round.
        offset: reading at zero.
        dof: the degree of freedom that it drives or reads.
    """

    name: str
    column: Column | None = None
    unit: str | None = None
    factor: float = 1.0
    sensitivity: float = 1.0
    sign: Literal[1, -1] = 1
    offset: float = 0.0
    dof: str = ""

    @model_validator(mode="after")
    def _scaled(self) -> ChannelPart:
        if not self.factor or not self.sensitivity:
            raise ValueError(f"factor and sensitivity of channel {self.name!r} must not be zero")
        return self

    @property
    def scale(self) -> float:
        """Values per reading, with the sign."""
        return self.sign * self.factor / self.sensitivity


class TablePart(Part):
    """How a text table is written.

    Attributes:
        delimiter: what stands between columns; found from the lines when only one fits.
        header_lines: lines before the numbers; found when left out.
        columns: names of the columns, for files that do not name them.
        decimal: decimal sign.
        missing: texts that mark a missing sample, besides NaN.
    """

    delimiter: Literal["tab", "comma", "semicolon", "space"] | None = None
    header_lines: NonNegativeInt | None = None
    columns: list[str] | None = None
    decimal: Literal[".", ","] = "."
    missing: list[str] = []


class ArraysPart(Part):
    """How arrays are laid out.

    Attributes:
        samples: "rows" when time runs down the first axis, "columns" when it runs along the second.
    """

    samples: Literal["rows", "columns"] | None = None


class BlocksPart(Part):
    """Which files of a folder belong together.

    Attributes:
        files: pattern of their names, taken in natural order (data2 before data10).
        stack: "time" joins them to one record, "records" makes each one a record.
    """

    files: str
    stack: Literal["time", "records"]


class RecordPart(Part):
    """A stretch of the samples that becomes a record of its own.

    Attributes:
        start, stop: first sample, counted from 0, and the one after the last.
        kind: what drove the structure; that of the recipe when left out.
        note: free text.
    """

    start: NonNegativeInt = 0
    stop: NonNegativeInt | None = None
    kind: Kind | None = None
    note: str = ""


class FrequencyPart(Part):
    """Where the frequencies of frequency responses are, their unit, and what is known of the responses.

    Attributes:
        column: of the frequencies.
        unit: likewise.
        lowest, highest: lines kept [Hz]; all when left out.
        scale: which complex factors on the responses nobody knows.
    """

    column: Column
    unit: Literal["Hz", "kHz", "rad/s"]
    lowest: NonNegativeFloat = 0.0
    highest: PositiveFloat | None = None
    scale: Literal["known", "unknown per input", "unknown per response"] = "known"


class ResponsePart(Part):
    """One frequency response, as complex values, real and imaginary part, or magnitude and phase.

    Attributes:
        output, input: names of channels described under [[outputs]] and [[inputs]].
        file: which file of the folder holds it, where there are several.
        value: column of complex values.
        real, imaginary, magnitude, phase: columns.
        magnitude_unit: "linear", or "dB" for 20 lg of the ratio.
        phase_unit: "deg" or "rad".
        derivatives: how many time derivatives of the response the values are, beyond what the units say (-1 is an integral).
    """

    output: str
    input: str
    file: str | None = None
    value: Column | None = None
    real: Column | None = None
    imaginary: Column | None = None
    magnitude: Column | None = None
    phase: Column | None = None
    magnitude_unit: Literal["linear", "dB"] | None = None
    phase_unit: Literal["deg", "rad"] | None = None
    derivatives: Annotated[int, Field(ge=-4, le=4)] = 0

    @model_validator(mode="after")
    def _one_form(self) -> ResponsePart:
        given = {name for name in _FORM_KEYS if getattr(self, name) is not None}
        if given not in _FORMS:
            raise ValueError(
                f"response of {self.output!r} to {self.input!r} needs value, or real and imaginary, or "
                "magnitude and phase with magnitude_unit and phase_unit"
            )
        return self


assert get_args(FrequencyPart.model_fields["scale"].annotation) == SCALES

_FORMS: tuple[set[str], ...] = (
    {"value"},
    {"real", "imaginary"},
    {"magnitude", "phase", "magnitude_unit", "phase_unit"},
)
_FORM_KEYS = sorted(set().union(*_FORMS))
