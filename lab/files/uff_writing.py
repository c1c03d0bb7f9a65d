"""Recordings, frequency responses and modes -> universal files: data sets 151, 164, 15, 82, 58 and 55, in SI."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identification.modes import Modes
from identification.recording import DERIVATIVE, Channel, Recording
from identification.response import FrequencyResponse
from lab.errors import FileError
from lab.files.exporting_points import Points
from lab.files.recording_geometry import Geometry
from lab.files.uff import PROGRAM, RESPONSE, TIME
from lab.files.uff_functions import function_bytes
from lab.files.uff_units import TYPES

FREQUENCY = 18
"""Specific data type of a frequency axis."""

Set = dict[str, Any]


def header_sets(title: str) -> list[Set]:
    """Data sets 151 and 164: who wrote the file, and that it is in SI."""
    return [
        {
            "type": 151,
            "model_name": title[:80] or "NONE",
            "description": "NONE",
            "db_app": PROGRAM,
            "program": PROGRAM,
        },
        {
            "type": 164,
            "units_code": 1,
            "units_description": "SI",
            "temp_mode": 1,
            **{"length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15},
        },
    ]


def geometry_sets(geometry: Geometry) -> list[Set]:
    """Data sets 15 and, where there are lines, 82."""
    x, y, z = geometry.positions.T
    nodes: Set = {"type": 15, "node_nums": list(geometry.nodes), "x": x, "y": y, "z": z}
    if not geometry.lines:
        return [nodes]
    # A trace lifts the pen before every line.
    trace = np.array([[0, a, b] for a, b in geometry.lines]).ravel()[1:]
    # Record 2 of the data set limits a trace to 250 nodes.
    pieces = [trace[start : start + 249] for start in range(0, trace.size, 249)]
    return [nodes, *({"type": 82, "trace_num": k, "nodes": piece} for k, piece in enumerate(pieces, 1))]


def signal_sets(recording: Recording, points: Points, *, binary: bool) -> list[Set]:
    """Data sets 58, one per channel and record: what, where, and on the ID lines names, sides, kinds and the rate.

    Raises:
        FileError: a sample is missing, for which the format has no sign, or a record has one sample only.
    """
    sets = []
    for number, record in enumerate(recording.records):
        if record.n_samples < 2:
            raise FileError(
                f"record {number} has {record.n_samples} samples; a universal file needs two or more"
            )
        sides = [("input", recording.inputs, record.inputs), ("output", recording.outputs, record.outputs)]
        for side, channels, signals in sides:
            if not signals.shape[0]:
                continue
            for row, channel in enumerate(channels):
                if len(channel.name) > 80:
                    raise FileError(f"channel name {channel.name!r} exceeds the 80 characters of an ID line")
                signal = np.asarray(signals[row, :], dtype=np.float64)
                if not np.isfinite(signal).all():
                    raise FileError(
                        f"channel {channel.name!r} of record {number} misses samples, which a universal file "
                        "cannot say; export to .csv, or cut the recording"
                    )
                about = (
                    channel.name,
                    side,
                    record.start_time or "NONE",
                    f"record {number}, kind {record.kind}",
                )
                axis = np.arange(signal.size) / recording.sample_rate
                made = _function(
                    1, about, signal, axis, f"sample rate {float(recording.sample_rate)!r} Hz", binary
                )
                made |= _abscissa(TIME, "Time", "s") | _end("rsp", points, channel)
                sets.append(
                    made | _ordinate("ordinate", channel, side) | _end("ref", points, None) | _NO_AXIS
                )
    return sets


def response_sets(response: FrequencyResponse, points: Points, *, binary: bool) -> list[Set]:
    """Data sets 58 of function type 4, one per output and input.

    Raises:
        FileError: one line only.
    """
    f = response.frequency_hz
    if f.size < 2:
        raise FileError(f"the frequency responses have {f.size} lines; a universal file needs two or more")
    sets = []
    for row, output in enumerate(response.outputs):
        for column, input_ in enumerate(response.inputs):
            about = (output.name, input_.name, "NONE", "frequency response")
            made = _function(RESPONSE, about, response.values[:, row, column], f, "NONE", binary)
            made |= _abscissa(FREQUENCY, "Frequency", "Hz") | _end("rsp", points, output)
            made |= _end("ref", points, input_) | _ordinate("ordinate", output, "output")
            sets.append(made | _ordinate("orddenom", input_, "input"))
    return sets


def mode_sets(modes: Modes, points: Points) -> tuple[list[Set], list[str]]:
    """Data sets 55 of complex modes, shapes in displacement, and what was left out.

    Velocities and accelerations are divided by λ and λ², so that all channels of a shape mean the same.

    Raises:
        FileError: no channel has a point, or a mode does not oscillate.
    """
    if np.any(np.abs(modes.damping_ratio) >= 1):
        raise FileError("a mode does not oscillate (damping ratio of 1 or more); leave it out")
    left = []
    kept: dict[tuple[int, int], int] = {}
    for row, channel in enumerate(modes.outputs):
        place = points.places.get(channel.name)
        if channel.quantity not in DERIVATIVE:
            left.append(f"{channel.name!r} left out: it measures no motion")
        elif place is None:
            left.append(f"{channel.name!r} left out: its node and direction are unknown")
        elif abs(place[1]) > 3:
            left.append(f"{channel.name!r} left out: complex shapes in data set 55 have no rotations here")
        elif (place[0], abs(place[1])) in kept:
            first = modes.outputs[kept[place[0], abs(place[1])]].name
            left.append(f"{channel.name!r} left out: {first!r} measures the same")
        else:
            kept[place[0], abs(place[1])] = row
    if not kept:
        raise FileError(
            "no channel has a node and a direction; give --model or --points"
            + (f" ({left[0]})" if left else "")
        )
    poles = modes.poles
    power = np.array([DERIVATIVE.get(channel.quantity, 0) for channel in modes.outputs])
    shapes = modes.shapes / poles ** power[:, None]  # (n_outputs, n_modes), displacement
    nodes = sorted({node for node, _ in kept})
    sets = []
    for k, pole in enumerate(poles):
        shape = np.zeros((3, len(nodes)), dtype=complex)
        for (node, code), row in kept.items():
            sign = np.sign(points.places[modes.outputs[row].name][1])
            shape[code - 1, nodes.index(node)] = sign * shapes[row, k]
        sets.append(
            {
                "type": 55,
                "id1": f"mode {k + 1}",
                "id4": f"{float(modes.frequency_hz[k])!r} Hz, damping ratio {float(modes.damping_ratio[k])!r}",
                **{"model_type": 1, "analysis_type": 3, "data_ch": 2, "spec_data_type": 8},
                **{"load_case": 1, "mode_n": k + 1, "eig": pole, "node_nums": nodes},
                **{f"r{axis + 1}": shape[axis] for axis in range(3)},
            }
        )
    return sets, left


def write_sets(sets: Sequence[Set], path: Path) -> None:
    """Writes data sets to a new file."""
    import pyuff

    path.write_bytes(b"")
    file = pyuff.UFF(str(path))
    for each in sets:
        if each["type"] == 58:
            with path.open("ab") as end:
                end.write(function_bytes(each))
        else:
            file.write_sets(dict(each), mode="add")


def _function(
    kind: int, about: Sequence[str], data: np.ndarray, axis: np.ndarray, last: str, binary: bool
) -> Set:
    steps = np.diff(axis)
    even = bool(np.allclose(steps, steps[0], rtol=1e-9, atol=0))
    # Seven digits of the step must not move the last line: uneven axes are written number by number.
    if kind == RESPONSE:
        rounded = float(f"{axis[0]:.6e}") + float(f"{steps[0]:.6e}") * np.arange(axis.size)
        even = even and bool(np.allclose(rounded, axis, rtol=1e-12, atol=0))
    return {
        "type": 58,
        "binary": int(binary),
        "func_type": kind,
        **{f"id{k}": (text or "NONE")[:80] for k, text in enumerate([*about, last], 1)},
        "data": data,
        "x": axis,
        "abscissa_spacing": int(even or kind == 1),
    }


def _abscissa(kind: int, label: str, unit: str) -> Set:
    return {
        "abscissa_spec_data_type": kind,
        "abscissa_axis_lab": label,
        "abscissa_axis_units_lab": unit,
    }


def _ordinate(axis: str, channel: Channel, side: str) -> Set:
    force = channel.quantity == "force" and side == "input"
    return {
        f"{axis}_spec_data_type": 13 if force else TYPES.get(channel.unit, 0),
        f"{axis}_axis_lab": channel.quantity.capitalize()[:20],
        f"{axis}_axis_units_lab": channel.unit,
    }


_NO_AXIS = {"orddenom_spec_data_type": 0, "orddenom_axis_lab": "NONE", "orddenom_axis_units_lab": "NONE"}


def _end(end: str, points: Points, channel: Channel | None) -> Set:
    node, code = (0, 0) if channel is None else points.places.get(channel.name, (0, 0))
    return {f"{end}_node": node, f"{end}_dir": code}
