"""Simulate: a rig under a load gives a recording, through MuJoCo and the whole measurement chain."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.recording import Array, Record, Recording
from lab import stepping
from lab.accuracy import accurate, root_mean_square
from lab.bench import Bench, Progress
from lab.excitation import Excitation
from lab.files.recording import RecordingWriter, load
from lab.loads import BLOCK
from lab.rig import Rig

PICTURE_ACCURACY = 1e-3


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of every degree of freedom, for pictures.

    Attributes:
        time: shape (n_samples,) [s].
        position: displacement from the operating point, shape (n_dofs, n_samples) [m or rad].
        inputs: commanded inputs, shape (n_inputs, n_samples).
    """

    time: Array
    position: Array
    inputs: Array


def simulate(
    rig: Rig,
    excitation: Excitation,
    *,
    sample_rate: float,
    duration: float,
    n_runs: int = 1,
    seed: int = 0,
    accuracy: float | None = None,
    substeps: int | None = None,
    progress: Progress | None = None,
) -> Recording:
    """The recording that a test bench would deliver.

    Args:
        rig: structure and measurement chain; it starts at rest at its operating point, where instruments are zeroed.
        excitation: how it is driven.
        sample_rate: [Hz].
        duration: of each record [s].
        n_runs: how often the test is repeated, with fresh randomness.
        seed: of everything random; the same seed gives the same recording to the last bit.
        accuracy: largest error of the simulated response relative to the largest value of its channel; when None, a
            thousandth of the smallest noise in the chain, or 1e-9 when it adds none, as far as 256 substeps go.
        substeps: per sample, in place of an accuracy; the error is not measured then.
        progress: called with the number of samples done since the last call.

    Returns:
        Recording with the attribute `simulation_error`, the measured relative error of the response.

    Raises:
        LabError: the accuracy cannot be reached, or the excitation does not fit the rig.
        DivergedError: the motion is no longer finite.
    """
    bench = Bench.loaded(rig, excitation, sample_rate, duration, n_runs, seed)
    bench = accurate(bench, accuracy) if substeps is None else replace(bench, plan=stepping.Plan(substeps))
    records = []
    for number, (load_, blocks) in enumerate(bench.responses(progress)):
        parts = list(blocks)
        if rig.chain.whole_record:
            parts = [
                (np.concatenate([a for a, _ in parts], axis=1), np.concatenate([b for _, b in parts], axis=1))
            ]
        digitize = bench.digitizer(
            number, root_mean_square(part[0] for part in parts), root_mean_square(part[1] for part in parts)
        )
        digitized = [digitize(a, b) for a, b in parts]
        measured = [part[0] for part in digitized] if load_.measured else [np.zeros((0, load_.n_samples))]
        outputs = np.concatenate([part[1] for part in digitized], axis=1)
        records.append(Record(load_.kind, np.concatenate(measured, axis=1), outputs))
    return Recording(
        tuple(records), rig.inputs, rig.outputs, sample_rate, rig.name, "virtual modal lab", bench.attributes
    )


def simulate_to_file(
    path: str | Path,
    rig: Rig,
    excitation: Excitation,
    *,
    sample_rate: float,
    duration: float,
    n_runs: int = 1,
    seed: int = 0,
    accuracy: float | None = None,
    progress: Progress | None = None,
) -> None:
    """Writes the recording of `simulate` block by block, however long it is; the same values to the last bit."""
    bench = accurate(Bench.loaded(rig, excitation, sample_rate, duration, n_runs, seed), accuracy)
    path = Path(path)
    about = (rig.inputs, rig.outputs, sample_rate)
    whole = RecordingWriter(
        path, *about, title=rig.name, source="virtual modal lab", attributes=bench.attributes
    )
    with whole as final, tempfile.TemporaryDirectory(dir=path.parent) as folder:
        for number, (load_, blocks) in enumerate(bench.responses(progress, one_by_one=True)):
            # Noise relative to a record's RMS is known only at the record's end: keep the clean record until then.
            clean = Path(folder) / "clean.h5"
            with RecordingWriter(clean, *about) as writer:
                writer.start(load_.kind)
                for inputs, outputs in blocks:
                    writer.append(inputs, outputs)
            record = load(clean, lazy=True).records[0]
            rms = (root_mean_square(block[side] for block in record.blocks(BLOCK)) for side in (0, 1))
            digitize = bench.digitizer(number, *rms)
            final.start(load_.kind)
            for inputs, outputs in record.blocks(record.n_samples if rig.chain.whole_record else BLOCK):
                inputs, outputs = digitize(inputs, outputs)
                final.append(inputs if load_.measured else np.zeros((0, outputs.shape[1])), outputs)


def motion(
    rig: Rig,
    excitation: Excitation,
    *,
    sample_rate: float,
    duration: float,
    seed: int = 0,
    progress: Progress | None = None,
) -> Motion:
    """Motion of the first record of the same test, accurate enough to look at; its error is not measured."""
    bench = Bench.loaded(rig, excitation, sample_rate, duration, 1, seed)
    bench = replace(bench, plan=stepping.first_guess(rig, 1 / sample_rate, PICTURE_ACCURACY, duration))
    first = bench.loads[0]
    inputs, positions = [], []
    for part in bench.batch([first], progress):
        inputs.append(part.commands[0])
        positions.append(part.positions[0])
    return Motion(
        np.arange(first.n_samples) / sample_rate,
        np.concatenate(positions, axis=1),
        np.concatenate(inputs, axis=1),
    )
