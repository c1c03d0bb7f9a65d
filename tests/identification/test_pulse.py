"""Pulse records and free decays as Markov parameters."""

import numpy as np
import pytest

from identification.era import era
from identification.errors import RecordingError
from identification.pulse import markov_parameters
from identification.recording import Record, Recording
from tests import systems

MODEL = systems.paper_chain3("coupled")


@pytest.mark.parametrize("height", [1.0, -0.25, 3e4])
def test_pulse_records_are_the_markov_parameters(height):
    found = markov_parameters(systems.pulse_recording(MODEL, 50, height=height))
    np.testing.assert_allclose(found.values, MODEL.markov(50).values, rtol=0, atol=1e-15)
    assert found.inputs == MODEL.inputs


def test_records_may_come_in_any_order_and_begin_before_the_pulse():
    recording = systems.pulse_recording(MODEL, 50)
    late = [
        Record(
            "pulse",
            np.pad(np.asarray(r.inputs), ((0, 0), (7, 0))),
            np.pad(np.asarray(r.outputs), ((0, 0), (7, 0))),
        )
        for r in reversed(recording.records)
    ]
    found = markov_parameters(Recording(tuple(late), MODEL.inputs, MODEL.outputs, recording.sample_rate))
    np.testing.assert_allclose(found.values, MODEL.markov(50).values, rtol=0, atol=1e-15)


def test_repeated_pulses_are_averaged_by_least_squares():
    rng = np.random.default_rng(0)
    heights = np.array([1.0, 2.0, 0.5])
    records = []
    for h in heights:
        for record in systems.pulse_recording(MODEL, 40, height=h).records:
            noise = 0.01 * rng.standard_normal(record.outputs.shape)
            records.append(Record("pulse", record.inputs, np.asarray(record.outputs) + noise))
    recording = Recording(tuple(records), MODEL.inputs, MODEL.outputs, 1 / MODEL.dt)
    found = markov_parameters(recording)
    for j in range(2):
        y = np.stack([np.asarray(records[2 * i + j].outputs) for i in range(3)])
        expected = np.linalg.lstsq(heights[:, None], y.reshape(3, -1), rcond=None)[0].reshape(2, 40).T
        np.testing.assert_allclose(found.values[:, :, j], expected, atol=1e-14)


def with_inputs(change):
    recording = systems.pulse_recording(MODEL, 30)
    u = np.array(recording.records[0].inputs)
    change(u)
    records = (Record("pulse", u, recording.records[0].outputs), recording.records[1])
    return Recording(records, MODEL.inputs, MODEL.outputs, recording.sample_rate)


def test_an_input_that_is_no_pulse_is_named():
    def second_sample(u):
        u[0, 1] = 0.5

    with pytest.raises(RecordingError, match=r"record 0 is no pulse: input 'force_x1' has 1 at sample 0 and"):
        markov_parameters(with_inputs(second_sample))


def test_a_pulse_on_two_inputs_at_once_is_named():
    def both(u):
        u[1, 0] = 1.0

    with pytest.raises(RecordingError, match="'force_x2' has 1 at sample 0"):
        markov_parameters(with_inputs(both))


def test_a_record_without_a_pulse_is_named():
    with pytest.raises(RecordingError, match="record 0 is of kind pulse and its inputs are zero"):
        markov_parameters(with_inputs(lambda u: u.fill(0)))


def test_an_input_without_a_pulse_is_named():
    recording = systems.pulse_recording(MODEL, 30)
    only_first = Recording(recording.records[:1], MODEL.inputs, MODEL.outputs, recording.sample_rate)
    with pytest.raises(RecordingError, match="no record has a pulse on input force_x2"):
        markov_parameters(only_first)


def test_noise_of_the_force_channel_passes():
    rng = np.random.default_rng(2)

    def noise(u):
        u += 0.005 * rng.standard_normal(u.shape)

    assert markov_parameters(with_inputs(noise)).n_lags == 30


def test_other_kinds_are_sent_to_okid():
    u = np.random.default_rng(0).standard_normal((2, 20))
    with pytest.raises(RecordingError, match="use okid"):
        markov_parameters(systems.recorded(MODEL, [u]))


def test_a_missing_sample_is_named():
    recording = systems.pulse_recording(MODEL, 30)
    y = np.array(recording.records[1].outputs)
    y[0, 4] = np.nan
    records = (recording.records[0], Record("pulse", recording.records[1].inputs, y))
    with pytest.raises(RecordingError, match=r"misses a sample at t = 0.2 s"):
        markov_parameters(Recording(records, MODEL.inputs, MODEL.outputs, recording.sample_rate))


def free_decays(n_samples=200):
    rng = np.random.default_rng(6)
    records = []
    for _ in range(3):
        y = MODEL.simulate(np.zeros((2, n_samples)), rng.standard_normal(6))
        records.append(Record("free_decay", np.zeros((0, n_samples)), y))
    return Recording(tuple(records), MODEL.inputs, MODEL.outputs, 1 / MODEL.dt)


def test_free_decays_give_the_poles_and_the_released_motion():
    recording = free_decays()
    found = markov_parameters(recording)
    assert [channel.name for channel in found.inputs] == ["release1", "release2", "release3"]
    assert all(channel.dof == "" for channel in found.inputs)
    system = era(found, 6).system
    # Exact data of a well-conditioned system, so rounding times ten or a hundred.
    expected, own = (np.sort_complex(model.eigen()[0]) for model in (MODEL, system))
    np.testing.assert_allclose(own, expected, atol=1e-11)
    released = system.simulate(np.zeros((3, 200)), system.B[:, 1])
    np.testing.assert_allclose(released, recording.records[1].outputs, atol=1e-12)


def test_a_free_decay_under_force_is_refused():
    recording = free_decays()
    u = np.zeros((2, 200))
    u[0, 3] = 1
    records = (Record("free_decay", u, recording.records[0].outputs),)
    with pytest.raises(RecordingError, match="cut it to the time after the release"):
        markov_parameters(Recording(records, MODEL.inputs, MODEL.outputs, recording.sample_rate))
