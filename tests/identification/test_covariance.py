"""Output covariances against a plain double loop, and what bad data are told."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification import covariance
from identification.covariance import output_covariances
from identification.errors import IdentificationError, RecordingError, TooShortError
from identification.recording import Channel, Record, Recording
from tests.ambient import output_record


def recording_of(*outputs):
    channels = tuple(Channel(f"acc{i + 1}", "m/s^2") for i in range(len(outputs[0])))
    return Recording(tuple(output_record(y) for y in outputs), (), channels, 100.0)


def looped(recording, lags, rows):
    """The definition, one product at a time."""
    R = np.zeros((len(lags), len(recording.outputs), len(rows)))
    terms = np.zeros(len(lags))
    for record in recording.records:
        y = np.array(record.outputs)
        y -= y.mean(axis=1, keepdims=True)
        for number, k in enumerate(lags):
            for j in range(y.shape[1] - k):
                R[number] += np.outer(y[:, j + k], y[rows, j])
                terms[number] += 1
    return R / terms[:, None, None]


@pytest.fixture
def two_records():
    rng = np.random.default_rng(1)
    return recording_of(rng.standard_normal((3, 700)) + 5, rng.standard_normal((3, 37)) - 2)


@pytest.mark.parametrize("first_lag", [0, 1, 4])
@pytest.mark.parametrize("n_lags", [1, 2, 30, 60, 300])
def test_equals_the_double_loop(two_records, n_lags, first_lag):
    R = output_covariances(two_records, n_lags, references=["acc3", "acc1"], first_lag=first_lag)
    expected = looped(two_records, range(first_lag, first_lag + n_lags), [2, 0])
    # Sums of 700 products of order one, each with a rounding error of 1e-16 or so.
    np.testing.assert_allclose(R, expected, atol=1e-13)


@pytest.mark.parametrize("n_segments", [1, 3, 64])
def test_the_size_of_blocks_changes_nothing_but_rounding(monkeypatch, n_segments):
    recording = recording_of(np.random.default_rng(2).standard_normal((2, 30_000)))
    whole = output_covariances(recording, 20)
    monkeypatch.setattr(covariance, "SEGMENTS", n_segments)
    np.testing.assert_allclose(output_covariances(recording, 20), whole, atol=1e-14)


class OnDisk:
    """Rows of samples that count how many are asked for at a time."""

    def __init__(self, values):
        self.values = np.asarray(values, dtype=np.float32)
        self.shape = self.values.shape
        self.most = 0

    def __getitem__(self, key):
        part = self.values[key]
        self.most = max(self.most, part.shape[1])
        return part


def test_a_long_record_is_read_in_short_blocks():
    values = np.random.default_rng(3).standard_normal((2, 200_000)).astype(np.float32)
    disk = OnDisk(values)
    channels = (Channel("a", "m/s^2"), Channel("b", "m/s^2"))
    recording = Recording((Record("ambient", np.zeros((0, 0)), disk),), (), channels, 100.0)
    R = output_covariances(recording, 50)
    assert disk.most <= 20_000
    np.testing.assert_array_equal(R, output_covariances(recording_of(values), 50))


def test_a_large_offset_costs_no_digits():
    y = np.random.default_rng(4).standard_normal((2, 5000))
    R = output_covariances(recording_of(y), 5, first_lag=0)
    shifted = output_covariances(recording_of(y + 1e6), 5, first_lag=0)
    # y + 1e6 is itself rounded by up to 6e-11, and a covariance averages 5000 products of that with order one.
    np.testing.assert_allclose(shifted, R, atol=1e-11)


def test_sampled_sine_has_the_covariance_of_a_sine():
    # A whole number of periods: E[sin(a(j+k)) sin(aj)] = cos(ak) / 2, but for the end terms of order k / N.
    n, a = 100_000, 2 * np.pi / 50
    R = output_covariances(recording_of(np.sin(a * np.arange(n))[None]), 100)[:, 0, 0]
    np.testing.assert_allclose(R, np.cos(a * np.arange(1, 101)) / 2, atol=2 * 100 / n)


@given(
    seed=st.integers(0, 99),
    order=st.permutations(range(3)),
    scales=st.lists(st.floats(1e-3, 1e3), min_size=3, max_size=3),
)
@settings(max_examples=25, deadline=None)
def test_follows_order_and_scale_of_the_channels(seed, order, scales):
    y = np.random.default_rng(seed).standard_normal((3, 200))
    scale = np.array(scales)
    R = output_covariances(recording_of(y), 4)
    changed = output_covariances(recording_of((y * scale[:, None])[order]), 4)
    expected = (R * scale[:, None] * scale)[:, order][:, :, order]
    np.testing.assert_allclose(changed, expected, atol=1e-13 * np.max(scale) ** 2)


def test_records_without_samples_are_passed_over():
    y = np.random.default_rng(5).standard_normal((2, 100))
    both = recording_of(np.zeros((2, 0)), y)
    np.testing.assert_array_equal(output_covariances(both, 3), output_covariances(recording_of(y), 3))


def test_a_missing_sample_is_named(two_records):
    y = np.array(two_records.records[0].outputs)
    y[1, 250] = np.nan
    broken = replace(two_records, records=(output_record(y),))
    with pytest.raises(RecordingError, match=r"acc2.*t = 2\.5 s"):
        output_covariances(broken, 5)


def test_an_overflow_is_told():
    y = 1e200 * np.random.default_rng(6).standard_normal((1, 50))
    with pytest.raises(RecordingError, match="overflow"):
        output_covariances(recording_of(y), 5)


def test_too_short_a_record_is_told(two_records):
    with pytest.raises(TooShortError, match="lag 700 needs"):
        output_covariances(two_records, 700)


@pytest.mark.parametrize("references", [["acc9"], ["acc1", "acc1"], []])
def test_wrong_references_are_told(two_records, references):
    with pytest.raises(RecordingError, match="acc1, acc2, acc3"):
        output_covariances(two_records, 5, references=references)


@pytest.mark.parametrize(("n_lags", "first_lag"), [(0, 1), (3, -1)])
def test_lags_that_do_not_exist(two_records, n_lags, first_lag):
    with pytest.raises(IdentificationError, match="at least one lag"):
        output_covariances(two_records, n_lags, first_lag=first_lag)
