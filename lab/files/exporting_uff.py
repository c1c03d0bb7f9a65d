"""Modes, signals and frequency responses -> universal files, with the points that are known."""

from __future__ import annotations

from pathlib import Path

from identification.recording import Channel, Recording
from identification.response import FrequencyResponse
from lab.files.exporting_points import Points, load_points, named_points
from lab.files.exporting_source import Given, data_of, document_of, modes_from
from lab.files.recording_geometry import load_geometry
from lab.files.uff_writing import (
    geometry_sets,
    header_sets,
    mode_sets,
    response_sets,
    signal_sets,
    write_sets,
)


def write_modes_uff(given: Given, path: Path, *, text: bool) -> list[str]:
    """Writes modes as data sets 55; returns what was left out."""
    modes = modes_from(given)
    points = _points(given, modes.outputs)
    sets, left = mode_sets(modes, points)
    geometry = [] if points.geometry is None else geometry_sets(points.geometry)
    write_sets([*header_sets(str(document_of(given).get("title", ""))), *geometry, *sets], path)
    return [*points.notes, *left]


def write_data_uff(given: Given, path: Path, *, text: bool) -> list[str]:
    """Writes signals and frequency responses as data sets 58; returns what could not be told."""
    recording, response = data_of(given)
    channels = (*_side(recording, response, "inputs"), *_side(recording, response, "outputs"))
    points = _points(given, channels)
    sets = header_sets(recording.title if recording else "")
    sets += [] if points.geometry is None else geometry_sets(points.geometry)
    if recording is not None:
        sets += signal_sets(recording, points, binary=not text)
    if response is not None:
        sets += response_sets(response, points, binary=not text)
    write_sets(sets, path)
    return list(points.notes)


def _points(given: Given, channels: tuple[Channel, ...]) -> Points:
    if given.points is not None:
        return load_points(given.points)
    if given.model is not None:
        from lab.files.exporting_model import model_points
        from lab.files.model import load_model

        return model_points(load_model(given.model), channels)
    points = named_points(channels)
    geometry = None if given.recording is None else load_geometry(given.recording)
    return Points(points.places, geometry)


def _side(recording: Recording | None, response: FrequencyResponse | None, side: str) -> tuple[Channel, ...]:
    named = {each.name: each for holder in (response, recording) if holder for each in getattr(holder, side)}
    return tuple(named.values())
