"""Frequency responses in a recording file: the group /frequency_responses, beside the records or instead of them.

In it lie the data sets frequency (n_f,) [Hz] and values (n_f, n_outputs, n_inputs), complex, in output unit per
input unit, and coherence (n_f, n_outputs) where known; its attributes are input_names, input_units, output_names,
output_units, dofs and factors of both, sample_time [s], zero where the response is that to forces that vary
continuously, as an analyser measures it, and scale where complex factors on the values are unknown
(`identification.response.SCALES`).
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from identification.errors import IdentificationError
from identification.recording import Channel, Recording
from identification.response import FrequencyResponse
from lab.errors import FileError
from lab.files.recording_reader import check_format, one_line, open_file
from lab.files.recording_writer import FORMAT, VERSION, save
from lab.files.units import to_si

GROUP = "frequency_responses"


def save_responses(
    response: FrequencyResponse,
    path: str | Path,
    *,
    recording: Recording | None = None,
    title: str = "",
    source: str = "",
    attributes: Mapping[str, str | float] | None = None,
) -> None:
    """Writes frequency responses; an existing file is replaced once the new one is whole.

    Args:
        response: all of them.
        path: file to write.
        recording: samples that go into the same file.
        title, source: free text, where there is no recording that has its own.
        attributes: further facts, likewise.

    Raises:
        FileError: the file cannot be written.
    """
    path = Path(path)
    hidden = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")
    try:
        if recording is not None:
            save(recording, hidden)
        with h5py.File(hidden, "a" if recording is not None else "w") as file:
            if recording is None:
                file.attrs["format"], file.attrs["version"] = FORMAT, VERSION
                for name, value in {"title": title, "source": source, **(attributes or {})}.items():
                    file.attrs[name] = value
            _write(file.create_group(GROUP), response)
        os.replace(hidden, path)
    except OSError as error:
        hidden.unlink(missing_ok=True)
        reason = error.strerror or " ".join(str(error).split())
        raise FileError(f"{path}: cannot be written ({reason}); choose another place") from None
    except BaseException:
        hidden.unlink(missing_ok=True)
        raise


def load_responses(path: str | Path) -> FrequencyResponse:
    """The frequency responses in a recording file, in SI units.

    Raises:
        FileError: no such file, not HDF5, of another format or version, without responses, or damaged.
    """
    path = Path(path)
    with one_line(path):
        file = open_file(path)
        try:
            check_format(file)
            if GROUP not in file:
                raise FileError(f"holds no frequency responses; expected the group /{GROUP}")
            return _read(file[GROUP])
        except (IdentificationError, ValueError) as error:
            raise FileError(f"/{GROUP} is damaged ({error})") from None
        finally:
            file.close()


def has_responses(path: str | Path) -> bool:
    """Whether a recording file holds frequency responses."""
    with one_line(Path(path)):
        file = open_file(Path(path))
        try:
            check_format(file)
            return GROUP in file
        finally:
            file.close()


def only_responses(path: str | Path) -> bool:
    """Whether a recording file holds frequency responses and no samples."""
    with one_line(Path(path)):
        file = open_file(Path(path))
        try:
            check_format(file)
            return GROUP in file and "records" not in file
        finally:
            file.close()


def _write(group: Any, response: FrequencyResponse) -> None:
    group.create_dataset("frequency", data=response.frequency_hz)
    group.create_dataset("values", data=response.values)
    if response.coherence is not None:
        group.create_dataset("coherence", data=response.coherence)
    group.attrs["sample_time"] = response.dt
    group.attrs["n_averages"] = response.n_averages
    if response.scale != "known":
        group.attrs["scale"] = response.scale
    for side, channels in (("input", response.inputs), ("output", response.outputs)):
        group.attrs[f"{side}_names"] = _strings([channel.name for channel in channels])
        group.attrs[f"{side}_units"] = _strings([channel.unit for channel in channels])
        group.attrs[f"{side}_dofs"] = _strings([channel.dof for channel in channels])
        group.attrs[f"{side}_factors"] = np.array([channel.factor for channel in channels], dtype=float)


def _read(group: Any) -> FrequencyResponse:
    outputs, to_output = _channels(group, "output")
    inputs, to_input = _channels(group, "input")
    values = np.asarray(group["values"][()], dtype=np.complex128)
    if values.ndim != 3 or values.shape[1:] != (len(outputs), len(inputs)):
        raise FileError(
            f"{group.name}/values has shape {values.shape}; expected (n_f, {len(outputs)}, {len(inputs)})"
        )
    return FrequencyResponse(
        np.asarray(group["frequency"][()], dtype=np.float64),
        values * to_output[:, None] / to_input,
        float(group.attrs.get("sample_time", 0.0)),
        inputs,
        outputs,
        coherence=np.asarray(group["coherence"][()]) if "coherence" in group else None,
        n_averages=float(group.attrs.get("n_averages", 1.0)),
        scale=str(group.attrs.get("scale", "known")),
    )


def _channels(group: Any, side: str) -> tuple[tuple[Channel, ...], np.ndarray]:
    """Channels in SI units, and the factors that convert to them."""
    names, units = (_texts(group, f"{side}_{what}") for what in ("names", "units"))
    dofs = _texts(group, f"{side}_dofs") if f"{side}_dofs" in group.attrs else [""] * len(names)
    factors = np.atleast_1d(group.attrs.get(f"{side}_factors", np.ones(len(names))))
    channels = tuple(
        Channel(name, to_si(unit)[0], dof, float(factor))
        for name, unit, dof, factor in zip(names, units, dofs, factors, strict=True)
    )
    return channels, np.array([to_si(unit)[1] for unit in units])


def _texts(group: Any, name: str) -> list[str]:
    values = np.atleast_1d(group.attrs[name])
    return [value.decode() if isinstance(value, bytes) else str(value) for value in values]


def _strings(values: list[str]) -> np.ndarray:
    return np.array(values, dtype=h5py.string_dtype())
