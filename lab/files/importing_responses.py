"""Columns and a recipe -> frequency responses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.errors import IdentificationError
from identification.recording import Channel
from identification.response import FrequencyResponse
from lab.errors import FileError
from lab.files.importing_columns import AmbiguousFileError, Source
from lab.files.recipe import Recipe
from lab.files.recipe_parts import ChannelPart, FrequencyPart, ResponsePart
from lab.files.recipe_start import starting_recipe
from lab.files.units import to_si

HERTZ = {"Hz": 1.0, "kHz": 1e3, "rad/s": 1 / (2 * np.pi)}


def responses_of(sources: Sequence[Source], recipe: Recipe) -> FrequencyResponse:
    """The frequency responses that the columns of some files make.

    Args:
        sources: one, or several that `file` of each response tells apart.
        recipe: with frequency and responses.

    Raises:
        AmbiguousFileError: a channel has no unit.
        FileError: a column or channel is missing, frequencies differ or do not rise, a pair is missing or twice.
    """
    assert recipe.frequency is not None
    inputs, to_input = _channels(recipe.inputs, sources[0], "inputs")
    outputs, to_output = _channels(recipe.outputs, sources[0], "outputs")
    by_name = {source.path.name: source for source in sources}
    every = _frequency(sources[0], recipe.frequency)
    # What lies outside may be anything, also not a number.
    kept = _kept(every, recipe.frequency)
    frequency = every[kept]
    values = np.full((frequency.size, len(outputs), len(inputs)), np.nan, dtype=complex)
    for part in recipe.responses:
        source = _source(part, by_name)
        if not np.array_equal(_frequency(source, recipe.frequency), every):
            raise FileError(f"{source.path.name}: has other frequencies than {sources[0].path.name}")
        row, column = _position(part.output, outputs, "outputs"), _position(part.input, inputs, "inputs")
        if not np.isnan(values[:, row, column]).all():
            raise FileError(f"the response of {part.output!r} to {part.input!r} is given twice")
        H = _integrated(_values(source, part)[kept], frequency, part)
        values[:, row, column] = H * to_output[row] / to_input[column]
    lacking = np.argwhere(np.isnan(values).all(axis=0))
    if lacking.size:
        row, column = lacking[0]
        raise FileError(
            f"the response of {outputs[row].name!r} to {inputs[column].name!r} is missing in [[responses]]"
        )
    try:
        return FrequencyResponse(frequency, values, 0.0, inputs, outputs, scale=recipe.frequency.scale)
    except IdentificationError as error:
        raise FileError(str(error)) from None


def _channels(
    parts: Sequence[ChannelPart], source: Source, side: str
) -> tuple[tuple[Channel, ...], list[float]]:
    """Channels in SI, and SI values per reading."""
    if not parts:
        raise FileError(f"the recipe names no [[{side}]]; expected those of the responses")
    channels, factors = [], []
    for part in parts:
        if part.unit is None:
            raise AmbiguousFileError(
                f'channel {part.name!r} has no unit; add unit = "…"', starting_recipe(source)
            )
        if part.offset or part.column is not None:
            raise FileError(f"channel {part.name!r} of a frequency response takes neither column nor offset")
        si, factor = to_si(part.unit)
        channels.append(Channel(part.name, si, part.dof))
        factors.append(part.scale * factor)
    return tuple(channels), factors


def _source(part: ResponsePart, by_name: dict[str, Source]) -> Source:
    if part.file is None:
        if len(by_name) > 1:
            raise FileError(
                f"the response of {part.output!r} to {part.input!r} needs file = …; there are {len(by_name)}"
            )
        return next(iter(by_name.values()))
    if part.file not in by_name:
        raise FileError(f"file {part.file!r} does not exist; there are {', '.join(sorted(by_name)[:12])}")
    return by_name[part.file]


def _frequency(source: Source, part: FrequencyPart) -> np.ndarray:
    frequency = source.real(part.column) * HERTZ[part.unit]
    if not np.isfinite(frequency).all() or not np.all(np.diff(frequency) > 0):
        raise FileError(f"{source.path.name}: frequencies do not rise from line to line; expected them to")
    return frequency


def _kept(frequency: np.ndarray, part: FrequencyPart) -> np.ndarray:
    """Which lines lie between the lowest and the highest that are wanted."""
    highest = np.inf if part.highest is None else part.highest
    kept = (frequency >= part.lowest) & (frequency <= highest)
    if not kept.any():
        raise FileError(
            f"no line lies between {part.lowest:g} and {highest:g} Hz; there are {frequency.size} from {frequency[0]:g} to "
            f"{frequency[-1]:g} Hz"
        )
    return np.asarray(kept)


def _integrated(values: np.ndarray, frequency: np.ndarray, part: ResponsePart) -> np.ndarray:
    """Values without the time derivatives that they have beyond their units."""
    if part.derivatives > 0 and not frequency.all():
        raise FileError(
            f"the response of {part.output!r} to {part.input!r} is a time derivative, which tells nothing at 0 Hz; set lowest "
            "above 0 in [frequency]"
        )
    return np.asarray(values * (2j * np.pi * frequency) ** -part.derivatives)


def _position(name: str, channels: Sequence[Channel], side: str) -> int:
    names = [channel.name for channel in channels]
    if name not in names:
        raise FileError(f"channel {name!r} does not exist; [[{side}]] names {', '.join(names)}")
    return names.index(name)


def _values(source: Source, part: ResponsePart) -> np.ndarray:
    if part.value is not None:
        return np.asarray(source.columns[source.key(part.value)], dtype=complex)
    if part.real is not None and part.imaginary is not None:
        return source.real(part.real) + 1j * source.real(part.imaginary)
    assert part.magnitude is not None
    assert part.phase is not None
    magnitude, phase = source.real(part.magnitude), source.real(part.phase)
    if part.magnitude_unit == "dB":
        magnitude = 10.0 ** (magnitude / 20)
    if part.phase_unit == "deg":
        phase = np.deg2rad(phase)
    return np.asarray(magnitude * np.exp(1j * phase))
