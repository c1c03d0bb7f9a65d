"""Signals, modes and matrices -> CSV, MATLAB and Matrix Market."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from lab.errors import FileError
from lab.files.exporting_source import Given, document_of, samples_of
from lab.files.matlab import write_matlab

MATRICES = {
    "M": ("mass", "kg"),
    "C": ("damping", "N s/m"),
    "K": ("stiffness", "N/m"),
}
"""Letter of a matrix: its name and unit; either names a Matrix Market file."""


def write_csv(given: Given, path: Path, *, text: bool) -> list[str]:
    """Writes samples with names and units in the first line; numbers come back as they were."""
    recording = samples_of(given, ".csv")
    several = len(recording.records) > 1
    driven = [record.inputs.shape[0] > 0 for record in recording.records]
    inputs = recording.inputs if any(driven) else ()
    names = ["record"] * several + ["time [s]"]
    names += [f"{each.name} [{each.unit}]" for each in (*inputs, *recording.outputs)]
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(_cell(name) for name in names) + "\n")
        for number, record in enumerate(recording.records):
            start = 0
            for block_in, block_out in record.blocks(1 << 14):
                n = block_out.shape[1]
                # A record without measured forces among others has none to write.
                forces = block_in if block_in.shape[0] else np.full((len(inputs), n), np.nan)
                time = (start + np.arange(n)) / recording.sample_rate
                rows = np.vstack([np.full((int(several), n), number), time, forces, block_out])
                np.savetxt(
                    file, rows.T, fmt=["%d"] * several + ["%.17g"] * (len(rows) - several), delimiter=","
                )
                start += n
    return []


def _cell(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"\n') else text


def write_data_mat(given: Given, path: Path, *, text: bool) -> list[str]:
    """Writes samples as MATLAB variables: inputs, outputs, their names and units, sample_rate, kind."""
    recording = samples_of(given, ".mat")
    variables: dict[str, Any] = {"sample_rate": recording.sample_rate}
    for side, channels in (("input", recording.inputs), ("output", recording.outputs)):
        variables[f"{side}_names"] = [channel.name for channel in channels]
        variables[f"{side}_units"] = [channel.unit for channel in channels]
    for number, record in enumerate(recording.records):
        ending = f"_{number}" if len(recording.records) > 1 else ""
        variables[f"inputs{ending}"] = np.asarray(record.inputs[:, :])
        variables[f"outputs{ending}"] = np.asarray(record.outputs[:, :])
        variables[f"kind{ending}"] = record.kind
    write_matlab(path, variables)
    return []


def _second_order(document: dict[str, Any], given: Given) -> dict[str, Any]:
    matrices = document.get("second_order")
    if not matrices:
        raise FileError(f"{given.result}: holds no mass, damping and stiffness matrices; nothing to export")
    return dict(matrices)


def write_result_mat(given: Given, path: Path, *, text: bool) -> list[str]:
    """Writes M, C, K, their standard deviations and the modes as MATLAB variables."""
    document = document_of(given)
    matrices = document.get("second_order") or {}
    modes = document.get("modes") or []
    if not matrices and not modes:
        raise FileError(f"{given.result}: holds neither modes nor matrices; nothing to export")
    variables: dict[str, Any] = {}
    for letter, (name, _) in MATRICES.items():
        if matrices:
            variables[letter] = np.array(matrices[name], dtype=float)
        if matrices and matrices.get(f"{name}_std") is not None:
            variables[f"{letter}_std"] = np.array(matrices[f"{name}_std"], dtype=float)
    if matrices:
        variables["dofs"] = list(matrices["dofs"])
    if modes:
        variables["frequency_hz"] = np.array([mode["frequency_hz"] for mode in modes], dtype=float)
        variables["damping_ratio"] = np.array([mode["damping_ratio"] for mode in modes], dtype=float)
        variables["channels"] = list(modes[0]["shape"])
        variables["shapes"] = np.array([[complex(*v) for v in mode["shape"].values()] for mode in modes]).T
    write_matlab(path, variables)
    return [] if matrices else ["no matrices in the result; modes only"]


def matrix_market(stem: str) -> Callable[..., list[str]]:
    """Writer of the matrix that a file is named after: M, C, K or mass, damping, stiffness."""

    def write(given: Given, path: Path, *, text: bool) -> list[str]:
        letter = next((key for key, (name, _) in MATRICES.items() if stem in (key, name)), None)
        if letter is None:
            allowed = ", ".join(f"{key}.mtx" for key in MATRICES)
            raise FileError(f"{stem}.mtx: nothing says which matrix; expected one of {allowed}")
        name, unit = MATRICES[letter]
        matrices = _second_order(document_of(given), given)
        about = f" {name} [{unit}], degrees of freedom in order: {', '.join(matrices['dofs'])}"
        with path.open("wb") as file:
            scipy.io.mmwrite(file, np.array(matrices[name], dtype=float), comment=about, precision=17)
        return []

    return write
