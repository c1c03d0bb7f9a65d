"""SSI-data on data with and without noise, against a plain projection."""

import importlib
from dataclasses import replace

import numpy as np
import pytest

from identification.errors import RecordingError, TooShortError
from identification.recording import Channel, Recording
from identification.ssi import ssi_cov
from identification.ssi_data import ssi_data
from tests.ambient import DT, ambient, output_record
from tests.systems import chain7, instrumented, sensors

TRUTH = chain7().modes()


def test_decays_without_noise_are_exact():
    """Outputs that follow from the state alone: O X̂ has the rank of the structure, and nothing is squared."""
    system = instrumented(chain7(), sensors(chain7().dofs), ()).sampled(DT)
    start = np.random.default_rng(1).standard_normal((2, 14))
    records = tuple(output_record(system.simulate(np.zeros((0, 300)), x0), "free_decay") for x0 in start)
    # The mean of each record is taken off, which adds a state per record that does not move: a pole at one.
    found = ssi_data(Recording(records, (), system.outputs, 1 / DT), order=16, n_rows=6)
    np.testing.assert_allclose(found.system.modes().poles, TRUTH.poles, rtol=1e-8)


def test_equals_the_projection_written_out():
    recording = ambient([600, 300], 2)
    n_rows, rows = 4, [1, 6]
    past, future = [], []
    for record in recording.records:
        y = record.outputs - np.mean(record.outputs, axis=1, keepdims=True)
        for t in range(n_rows, y.shape[1] - n_rows + 1):
            past.append(np.concatenate([y[rows, t - 1 - lag] for lag in range(n_rows)]))
            future.append(np.concatenate([y[:, t + i] for i in range(n_rows)]))
    P, F = np.array(past).T, np.array(future).T
    projection = F @ P.T @ np.linalg.solve(P @ P.T, P)
    names = [recording.outputs[row].name for row in rows]
    found = ssi_data(recording, order=6, n_rows=n_rows, references=names)
    s = np.linalg.svd(projection, compute_uv=False)[: found.singular_values.size]
    # Outputs are divided by their common root mean square, and the matrix by the root of its columns.
    scale = np.sqrt(np.mean(np.hstack([r.outputs for r in recording.records]) ** 2)) * np.sqrt(P.shape[1])
    np.testing.assert_allclose(found.singular_values, s / scale, rtol=1e-6)


def test_the_size_of_blocks_changes_nothing_but_rounding(monkeypatch):
    recording = ambient(5_000, 3)
    whole = ssi_data(recording, order=14, n_rows=8).system.modes()
    monkeypatch.setattr(importlib.import_module("identification.ssi_data"), "VALUES", 1)
    parts = ssi_data(recording, order=14, n_rows=8).system.modes()
    np.testing.assert_allclose(parts.poles, whole.poles, rtol=1e-7)


def test_all_modes_of_a_long_record():
    found = ssi_data(ambient(40_000, 4), order=14, n_rows=8).system.modes()
    # Three standard deviations of some 0.1 % and 13 % and less, as for SSI-cov.
    np.testing.assert_allclose(found.frequency_hz, TRUTH.frequency_hz, rtol=5e-3)
    np.testing.assert_allclose(found.damping_ratio, TRUTH.damping_ratio, rtol=0.4)


def test_units_of_the_channels_do_not_matter():
    recording = ambient(3_000, 5)
    y = np.array(recording.records[0].outputs)
    channels = tuple(
        Channel(channel.name, "m" if i < 3 else "m/s^2") for i, channel in enumerate(recording.outputs)
    )
    scale = np.r_[np.full(3, 1e-6), np.ones(4)][:, None]
    here, there = (
        ssi_data(Recording((output_record(each),), (), channels, 1 / DT), order=10, n_rows=8).system.modes()
        for each in (y, y * scale)
    )
    np.testing.assert_allclose(there.poles, here.poles, rtol=1e-7)
    np.testing.assert_allclose(
        np.abs(there.shapes / scale / there.shapes[6]), np.abs(here.shapes / here.shapes[6]), rtol=1e-5
    )


def test_it_plans_like_ssi_cov():
    recording = ambient(6_000, 6)
    assert ssi_data(recording).settings == ssi_cov(recording).settings
    assert ssi_data(recording).orders == ssi_cov(recording).orders


def test_too_few_columns_are_told():
    with pytest.raises(TooShortError, match="use ssi_cov"):
        ssi_data(ambient(150, 7), order=4, n_rows=12)


def test_a_missing_sample_is_named():
    recording = ambient(1_000, 8)
    y = np.array(recording.records[0].outputs)
    y[2, 10] = np.nan
    with pytest.raises(RecordingError, match="acceleration_x3"):
        ssi_data(replace(recording, records=(output_record(y),)))
