"""NExT-ERA on exact covariances, on noisy sensors, and beside another reading of the same covariances."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from identification.errors import OrderError, RecordingError
from identification.modes import mac
from identification.next_era import next_era
from identification.recording import Record, Recording
from identification.ssi import ssi_cov
from identification.stability import stabilize
from tests import systems

STRUCTURE = systems.chain7()


def ambient(n_samples, seed, *, noise=0.0):
    system = systems.instrumented(
        STRUCTURE, systems.sensors(STRUCTURE.dofs), systems.actuators(STRUCTURE.dofs)
    )
    rng = np.random.default_rng(seed)
    record = systems.recorded(system.sampled(0.02), [rng.standard_normal((7, n_samples))]).records[0]
    y = systems.noisy(record.outputs, noise, rng)
    return Recording((Record("ambient", np.zeros((0, n_samples)), y),), (), system.outputs, 50.0)


def test_exact_covariances_give_back_poles_and_shapes_and_lag_zero_is_never_asked_for(monkeypatch):
    recording = ambient(1000, 0)
    truth = systems.instrumented(STRUCTURE, recording.outputs, systems.actuators(("x2", "x5"))).sampled(0.02)

    def covariances(recording, n_lags, *, references=None, first_lag=1):
        assert first_lag == 1
        return truth.markov(n_lags + 1).values[1:]  # C A^{k-1} G with G = B

    monkeypatch.setattr(sys.modules[next_era.__module__], "output_covariances", covariances)
    found = next_era(recording, 14, n_rows=30, references=["acceleration_x2", "acceleration_x5"])
    modes, expected = found.system.modes(), truth.modes()
    # Rounding, times the condition of the Hankel matrix.
    np.testing.assert_allclose(modes.frequency_hz, expected.frequency_hz, rtol=1e-10)
    np.testing.assert_allclose(modes.damping_ratio, expected.damping_ratio, rtol=1e-8)
    np.testing.assert_allclose(np.diag(mac(modes.shapes, expected.shapes)), 1, atol=1e-10)
    assert not found.system.inputs


def test_modes_of_a_chain_and_why_noise_on_the_sensors_does_not_bias_them():
    clean = ambient(100_000, 1)
    rng = np.random.default_rng(2)
    record = clean.records[0]
    noisy = replace(clean, records=(replace(record, outputs=systems.noisy(record.outputs, 0.5, rng)),))
    truth = STRUCTURE.modes()
    # Au (2014): 2000 s leave the damping uncertain by this much at best.
    variation = 1 / np.sqrt(2 * np.pi * truth.damping_ratio * 2000 * truth.frequency_hz)
    for recording in (clean, noisy):
        modes = stabilize(next_era(recording)).modes
        assert len(modes) == 7
        assert np.all(np.abs(modes.damping_ratio / truth.damping_ratio - 1) < 6 * variation)
        assert np.all(
            np.abs(modes.frequency_hz / truth.frequency_hz - 1) < 6 * variation * truth.damping_ratio
        )
        assert np.all(np.diag(mac(modes.shapes, truth.shapes)) > 0.98)


def test_it_reads_the_same_covariances_as_stochastic_subspaces():
    recording = ambient(20_000, 3, noise=0.1)
    a, b = (method(recording, 14, n_rows=30).system.modes() for method in (next_era, ssi_cov))
    # Both see the same scatter of the covariances, and differ by how they weigh it.
    np.testing.assert_allclose(a.frequency_hz, b.frequency_hz, rtol=3e-3)
    assert np.all(np.diag(mac(a.shapes, b.shapes)) > 0.99)


def test_the_choice_of_a_unit_does_not_decide():
    recording = ambient(5_000, 4)
    outputs = (*recording.outputs[:4], *(replace(channel, unit="m/s") for channel in recording.outputs[4:]))
    scale = np.where(np.arange(7) < 4, 1.0, 1e3)[:, None]
    record = recording.records[0]
    mixed = replace(recording, outputs=outputs)
    scaled = replace(mixed, records=(replace(record, outputs=scale * record.outputs),))
    a, b = (next_era(each, 14, n_rows=30).system.modes() for each in (mixed, scaled))
    np.testing.assert_allclose(b.frequency_hz, a.frequency_hz, rtol=1e-9)
    np.testing.assert_allclose(np.diag(mac(b.shapes, scale * a.shapes)), 1, atol=1e-9)


def test_orders_and_references_that_cannot_be_had():
    recording = ambient(2_000, 5)
    with pytest.raises(OrderError, match="order 80 exceeds"):
        next_era(recording, 80, n_rows=10)
    with pytest.raises(RecordingError, match="'nowhere'"):
        next_era(recording, references=["nowhere"])
    still = replace(recording, records=(Record("ambient", np.zeros((0, 500)), np.zeros((7, 500))),))
    with pytest.raises(OrderError, match="numerical rank"):
        next_era(still, orders=[2, 4], n_rows=5)
