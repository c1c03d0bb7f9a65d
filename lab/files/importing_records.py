"""Columns and a recipe -> recording: scaled to SI, cut into records."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from identification.errors import RecordingError
from identification.recording import Array, Channel, Record, Recording
from lab.errors import FileError
from lab.files.importing_columns import AmbiguousFileError, Source
from lab.files.importing_rate import check_time, even_rate
from lab.files.recipe import Recipe
from lab.files.recipe_parts import ChannelPart, RecordPart
from lab.files.recipe_start import starting_recipe
from lab.files.units import to_si

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}


def recording_of(sources: Sequence[Source], recipe: Recipe, kind: str, *, joined: bool) -> Recording:
    """The recording that the columns of some files make.

    Args:
        sources: one or more, all with the same channels.
        recipe: what the columns mean; channels that it leaves out are those that the files tell apart.
        kind: of records that state none.
        joined: whether the sources follow one another in time, rather than being records of their own.

    Raises:
        AmbiguousFileError: a unit or the rate is stated nowhere.
        FileError: a column is missing, lengths differ, time is uneven, nothing is left.
    """
    inputs, outputs = _parts(sources[0], recipe)
    channels = [[_channel(part, sources[0], recipe) for part in side] for side in (inputs, outputs)]
    rates, records = set(), []
    for group in [sources] if joined else [[source] for source in sources]:
        rows = [_rows(group, recipe, side) for side in (inputs, outputs)]  # (n_channels, n_samples) each
        time = _time(group, recipe)
        for first, last in recipe.missing:
            for signals in rows:
                signals[:, first:last] = np.nan
        for piece in _pieces(group, recipe, rows[1].shape[1]):
            cut = slice(piece.start, piece.stop)
            rates.add(_rate(group[0], recipe, None if time is None else time[cut]))
            note = "; ".join(text for text in (piece.note, group[0].note) if text)
            what = piece.kind or recipe.kind or group[0].kind or kind
            records.append(Record(what, rows[0][:, cut], rows[1][:, cut], group[0].start_time, note))
    try:
        # Rates computed from columns of time differ in the last digits.
        rate = float(np.median(list(rates)))
        if max(rates) - min(rates) > 1e-6 * rate:
            raise FileError(f"records have sample rates {sorted(rates)} Hz; expected one rate")
        return Recording(
            tuple(records), tuple(channels[0]), tuple(channels[1]), rate, recipe.title, recipe.source
        )
    except RecordingError as error:
        raise FileError(str(error)) from None


def _parts(source: Source, recipe: Recipe) -> tuple[list[ChannelPart], list[ChannelPart]]:
    """Channels of the recipe, or else those that the file tells apart."""
    if recipe.inputs or recipe.outputs:
        if not recipe.outputs:
            raise FileError("the recipe names no [[outputs]]; expected at least one response")
        return recipe.inputs, recipe.outputs
    if not source.columns:
        raise AmbiguousFileError(
            "holds no column of numbers that stands for itself; expected a recipe that takes its arrays apart",
            starting_recipe(source),
        )
    unknown = [name for name in source.columns if source.sides.get(name) not in ("input", "output")]
    if unknown:
        raise AmbiguousFileError(
            f"nothing says whether {unknown[0]!r} is an input or an output, nor in which unit; expected a "
            "recipe that does, give --recipe",
            starting_recipe(source),
        )
    inputs, outputs = (
        [ChannelPart(name=name) for name in source.columns if source.sides[name] == side]
        for side in ("input", "output")
    )
    if not outputs:
        raise AmbiguousFileError(
            "holds forces and no response; expected at least one output", starting_recipe(source)
        )
    return inputs, outputs


def _channel(part: ChannelPart, source: Source, recipe: Recipe) -> Channel:
    return Channel(part.name, to_si(_unit(part, source, recipe))[0], part.dof)


def _unit(part: ChannelPart, source: Source, recipe: Recipe) -> str:
    key = _key(part, source)
    unit = part.unit or source.units.get(key)
    if unit is None:
        raise AmbiguousFileError(
            f'channel {part.name!r} has no unit; neither file nor recipe states it, add unit = "…"',
            starting_recipe(source),
        )
    return unit


def _key(part: ChannelPart, source: Source) -> str:
    return source.key(part.name if part.column is None else part.column)


def _rows(sources: Sequence[Source], recipe: Recipe, parts: Sequence[ChannelPart]) -> Array:
    """Signals in SI, shape (n_channels, n_samples)."""
    rows = []
    for part in parts:
        pieces = []
        for source in sources:
            with_file = f"{source.path.name}: " if len(sources) > 1 else ""
            try:
                unit = _unit(part, source, recipe)
                readings = source.real(_key(part, source))
            except AmbiguousFileError:
                raise
            except FileError as error:
                raise FileError(f"{with_file}{error}") from None
            pieces.append((readings - part.offset) * (part.scale * to_si(unit)[1]))
        rows.append(np.concatenate(pieces))
    lengths = {part.name: row.size for part, row in zip(parts, rows, strict=True)}
    if len(set(lengths.values())) > 1:
        raise FileError(f"channels have {lengths} samples; expected equal lengths")
    return np.array(rows) if rows else np.zeros((0, _length(sources)))


def _length(sources: Sequence[Source]) -> int:
    return sum(int(np.size(next(iter(source.columns.values())))) for source in sources)


def _time(sources: Sequence[Source], recipe: Recipe) -> Array | None:
    if recipe.time is None:
        return None
    columns = [source.real(recipe.time) for source in sources]
    return np.concatenate(columns) * TIME_UNITS[recipe.time_unit]


def _rate(source: Source, recipe: Recipe, time: Array | None) -> float:
    """Stated rate, checked against the time, or that of the time [Hz]."""
    stated = recipe.sample_rate
    if isinstance(stated, str):
        if stated not in source.scalars:
            raise AmbiguousFileError(
                f"sample_rate = {stated!r} is no single number in the file; there are "
                f"{', '.join(source.scalars) or 'none'}, or give a number [Hz]",
                starting_recipe(source),
            )
        stated = source.scalars[stated]
    stated = stated or source.sample_rate
    if stated:
        if time is not None:
            check_time(time, stated)
        return float(stated)
    if time is None:
        raise AmbiguousFileError(
            "no sample rate; neither file nor recipe states it, add sample_rate [Hz] or time = column",
            starting_recipe(source),
        )
    return even_rate(time)


def _pieces(sources: Sequence[Source], recipe: Recipe, n: int) -> list[RecordPart]:
    """Which samples become which record."""
    pieces = recipe.records or [RecordPart()]
    if recipe.record is not None:
        label = np.concatenate([source.real(recipe.record) for source in sources])
        edges = [0, *(np.flatnonzero(np.diff(label)) + 1).tolist(), n]
        pieces = [RecordPart(start=a, stop=b) for a, b in itertools.pairwise(edges)]
    cut = []
    for piece in pieces:
        start = piece.start + recipe.drop_first
        stop = (n if piece.stop is None else piece.stop) - recipe.drop_last
        if (piece.stop or 0) > n or start >= stop:
            raise FileError(
                f"samples {start} to {stop} of {n} make no record; see records, drop_first and drop_last"
            )
        cut.append(piece.model_copy(update={"start": start, "stop": stop}))
    return cut
