"""Bench: the same bits however a test is cut, and randomness that a seed fixes."""

import dataclasses
import math
import os

import numpy as np
import pytest

import lab
from lab import excitation, stepping
from lab.chain import Chain
from lab.excitation import Ambient, FreeDecay, Pulse
from lab.files.recording import load
from lab.rig import Rig
from lab.simulate import simulate_to_file
from lab.stages import Delay, Dropout, Hum, Lag, LowPass, Noise
from tests.lab.oscillating import ONE, WHITE, one, run, same
from tests.lab.structures import (
    oscillator,
    true_error,
)

CHAINS = {
    "ideal": Chain(),
    "noisy": Chain(
        acquisition=(Noise("*", percent=5.0), Dropout("vel", 0.05)),
        force_sensors=(Noise("*", percent=1.0),),
        force_measured=True,
    ),
    "slow": Chain(
        actuators=(Lag("force", 3.0), Delay("force", 0.013)),
        sensors=(LowPass("acc.x", 4.0, 5), Delay("pos", 0.021), Hum("vel", 7.0, 0.1)),
        acquisition=(Noise("*", percent=1.0),),
    ),
}
DRIVES = {"pulse": Pulse(), "random": WHITE, "ambient": Ambient(), "free_decay": FreeDecay({"x": 1.0})}


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("chain", CHAINS)
def test_memory_and_file_hold_the_same_bits(chain, drive, tmp_path):
    settings = {"sample_rate": 20.0, "duration": 3.0, "n_runs": 2, "seed": 4, "accuracy": 1e-4}
    rig = one(CHAINS[chain])
    in_memory = lab.simulate(rig, DRIVES[drive], **settings)
    simulate_to_file(tmp_path / "r.h5", rig, DRIVES[drive], **settings)
    on_disk = load(tmp_path / "r.h5")
    assert same(in_memory, on_disk)
    assert on_disk.attributes == in_memory.attributes
    assert on_disk.inputs == in_memory.inputs
    assert on_disk.outputs == in_memory.outputs
    assert [r.kind for r in on_disk.records] == [r.kind for r in in_memory.records]
    assert (on_disk.title, on_disk.source) == (in_memory.title, in_memory.source)


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize("threads", [1, 3])
def test_threads_and_memory_do_not_matter(chain, threads, monkeypatch, tmp_path):
    settings = {"sample_rate": 20.0, "duration": 2.0, "n_runs": 3, "accuracy": 1e-3}
    rig = one(CHAINS[chain])
    expected = lab.simulate(rig, WHITE, **settings)
    monkeypatch.setattr(os, "cpu_count", lambda: threads)
    for chunk_bytes in (1, 100_000):
        monkeypatch.setattr(stepping, "CHUNK_BYTES", chunk_bytes)
        assert same(lab.simulate(rig, WHITE, **settings), expected)
    simulate_to_file(tmp_path / "r.h5", rig, WHITE, **settings)
    assert same(load(tmp_path / "r.h5"), expected)


@pytest.mark.parametrize("chain", ["ideal", "slow"])
@pytest.mark.parametrize("block", [1, 37])
def test_blocks_of_a_load_do_not_matter(chain, block, monkeypatch):
    """Without noise in percent, whose RMS is summed block by block, not even in the last bit."""
    rig = one(dataclasses.replace(CHAINS[chain], acquisition=()))
    expected = run(rig, WHITE, duration=5.0, accuracy=1e-4)
    monkeypatch.setattr(excitation, "BLOCK", block)
    assert same(run(rig, WHITE, duration=5.0, accuracy=1e-4), expected)


def test_long_records_run_through_many_blocks(tmp_path):
    """More samples than a block holds, in memory and into a file, against the exact response."""
    settings = {"sample_rate": 20.0, "duration": 210.0, "accuracy": 1e-5}
    rig = one(CHAINS["ideal"])
    recording = lab.simulate(rig, WHITE, **settings)
    assert recording.n_samples > excitation.BLOCK
    assert true_error(recording, ONE) <= 1e-5
    simulate_to_file(tmp_path / "r.h5", rig, WHITE, **settings)
    assert same(load(tmp_path / "r.h5"), recording)


def test_solver_with_dry_friction_is_cut_alike(monkeypatch, tmp_path):
    rig = Rig.from_xml(oscillator().replace('damping="0.4"', 'damping="0.4" frictionloss="0.1"'))
    settings = {"sample_rate": 20.0, "duration": 3.0, "n_runs": 2, "accuracy": 0.05}
    expected = lab.simulate(rig, WHITE, **settings)
    monkeypatch.setattr(stepping, "CHUNK_BYTES", 1)
    simulate_to_file(tmp_path / "r.h5", rig, WHITE, **settings)
    assert same(load(tmp_path / "r.h5"), expected)


@pytest.mark.parametrize("chain", ["ideal", "noisy"])
def test_a_seed_fixes_every_bit(chain):
    rig, settings = one(CHAINS[chain]), {"duration": 2.0, "n_runs": 2, "accuracy": 1e-4}
    first = run(rig, WHITE, seed=7, **settings)
    assert same(first, run(rig, WHITE, seed=7, **settings))
    other = run(rig, WHITE, seed=8, **settings)
    for record in (*other.records, first.records[1]):
        assert not np.array_equal(record.inputs, first.records[0].inputs)


def test_noise_differs_between_records_channels_and_seeds():
    rig = one(Chain(acquisition=(Noise("*", std=1.0),)))
    noise = [
        record.outputs - run(one(), FreeDecay({"x": 1.0}), accuracy=1e-6).records[0].outputs
        for seed in (0, 1)
        for record in run(rig, FreeDecay({"x": 1.0}), n_runs=2, seed=seed, accuracy=1e-6).records
    ]
    rows = np.vstack(noise)
    # Twelve independent rows of 200 samples.
    assert np.max(np.abs(np.corrcoef(rows) - np.eye(12))) < 5 / math.sqrt(200)


def test_noise_of_a_channel_does_not_depend_on_the_others():
    rig = one(Chain(acquisition=(Noise("*", std=1.0),)))
    settings = {"duration": 5.0, "accuracy": 1e-6}
    every = run(rig, WHITE, **settings).records[0].outputs
    for names, rows in ((["acc.x"], [2]), (["vel", "pos"], [1, 0])):
        some = run(rig.connected(outputs=names), WHITE, **settings).records[0].outputs
        # The response may be stepped differently; the noise may not differ.
        np.testing.assert_allclose(some, every[rows], atol=1e-5)


def test_noise_of_a_record_does_not_depend_on_how_many_there_are():
    rig, settings = one(CHAINS["noisy"]), {"duration": 2.0, "accuracy": 1e-4}
    many = run(rig, WHITE, n_runs=3, **settings)
    few = run(rig, WHITE, n_runs=1, **settings)
    np.testing.assert_array_equal(few.records[0].outputs, many.records[0].outputs)
