"""Envelopes and spectra for drawing, against plain loops, scipy and the exact frequency response."""

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.recording import Channel, Record, Recording
from identification.systems import SecondOrder
from lab.show.signals import (
    coherence,
    envelope,
    frequency_response,
    mean_density,
    measured_inputs,
    spectra,
    upper_frequency,
)

RNG = np.random.default_rng(1)


def recording(kinds, inputs, outputs, rate=100.0):
    records = tuple(Record(kind, u, y) for kind, u, y in zip(kinds, inputs, outputs, strict=True))
    channels_in = tuple(Channel(f"u{i}", "N") for i in range(inputs[0].shape[0]))
    channels_out = tuple(Channel(f"y{i}", "m") for i in range(outputs[0].shape[0]))
    return Recording(records, channels_in, channels_out, rate)


@settings(max_examples=40, deadline=None)
@given(n=st.integers(1, 400), n_bins=st.integers(1, 30), holes=st.booleans())
def test_envelope_equals_a_plain_loop(n, n_bins, holes):
    y = np.random.default_rng(n).standard_normal((2, n))
    if holes:
        y[0, :: max(2, n // 3)] = np.nan
    drawn = envelope(Record("other", np.zeros((0, n)), y), 10.0, n_bins=n_bins)
    if n <= 2 * n_bins:
        np.testing.assert_array_equal(drawn.outputs, y)
        return
    size = -(-n // n_bins)
    for k, start in enumerate(range(0, n, size)):
        for row in range(2):
            values = [v for v in y[row, start : start + size] if not np.isnan(v)]
            lowest, highest = drawn.outputs[row, 2 * k : 2 * k + 2]
            if values:
                assert (lowest, highest) == (min(values), max(values))
            else:
                assert np.isnan([lowest, highest]).all()
        assert drawn.time[2 * k] == pytest.approx(start / 10.0, abs=1e-12)
    assert drawn.outputs.shape[1] <= 2 * n_bins
    assert drawn.inputs.shape == (0, drawn.time.size)


def test_envelope_reads_only_slices():
    """Data on disk must not be pulled into memory whole."""

    class Disk:
        shape = (1, 1_000_000)
        largest = 0

        def __getitem__(self, key):
            start, stop, _ = key[1].indices(self.shape[1])
            self.largest = max(self.largest, stop - start)
            return np.sin(np.arange(start, stop))[None]

    signals = Disk()
    drawn = envelope(Record("ambient", np.zeros((0, 0)), signals), 1.0)
    assert signals.largest <= 1 << 17
    np.testing.assert_allclose(
        np.abs(drawn.outputs), 1, rtol=1e-2
    )  # 500 samples of a sine come near both peaks


def test_spectra_equal_welch_of_scipy():
    y = RNG.standard_normal((2, 5000)) + 3.0
    u = RNG.standard_normal((1, 5000))
    ours = spectra(recording(["random"], [u], [y]), n_segment=512, n_averages=1000)
    options = {"fs": 100.0, "window": "hann", "nperseg": 512, "noverlap": 256, "detrend": "constant"}
    frequency, density = scipy.signal.welch(y, **options)
    _, cross = scipy.signal.csd(u, y, **options)
    np.testing.assert_allclose(ours.frequency_hz, frequency, rtol=1e-14)
    np.testing.assert_allclose(ours.output_density, density, rtol=1e-10)  # the same sums in another order
    np.testing.assert_allclose(ours.cross_density[:, :, 0].T, cross, rtol=1e-9, atol=1e-15)


def test_few_segments_are_spread_over_the_recording():
    """Averaging only the beginning would miss what comes later."""
    y = np.zeros((1, 100_000))
    y[0, 50_000:] = RNG.standard_normal(50_000)
    few = spectra(recording(["random"], [y], [y]), n_segment=256, n_averages=50)
    assert few.n_averages <= 50
    power = np.sum(few.output_density) * few.frequency_hz[1]
    assert power == pytest.approx(
        0.5, rel=0.2
    )  # variance 1 in half of the segments; 25 segments scatter by some %


def test_frequency_response_of_pulses_is_exact():
    """Two pulses, one per input, that decay within the record give the model's response to rounding."""
    truth = SecondOrder(
        np.diag([1.0, 2.0]),
        np.array([[8.0, -2], [-2, 9.0]]),
        np.array([[900.0, -300], [-300, 800]]),
        ("a", "b"),
    )
    channels = tuple(Channel(d, "N", d) for d in "ab"), tuple(Channel(d, "m", d) for d in "ab")
    eye, zero = np.eye(2), np.zeros((2, 2))
    system = truth.state_space(eye, eye, zero, zero, *channels).sampled(0.01)
    n = 2000
    us = [np.eye(2)[:, [i]] * np.eye(1, n) for i in range(2)]
    rec = Recording(tuple(Record("pulse", u, system.simulate(u)) for u in us), *channels, 100.0)
    spectrum = spectra(rec)
    assert spectrum.window == "none"
    H = frequency_response(spectrum)
    exact = system.frequency_response(spectrum.frequency_hz)
    # The slowest pole decays by e^-40 over the record, so nothing is cut off.
    np.testing.assert_allclose(H, exact, atol=1e-10 * np.abs(exact).max())


def test_inputs_that_cannot_be_told_apart_give_no_response():
    u = RNG.standard_normal((1, 4000))
    assert frequency_response(spectra(recording(["random"], [np.vstack([u, 2 * u])], [u]))) is None


def test_output_only_recording_has_spectra_but_no_response():
    spectrum = spectra(recording(["ambient"], [np.zeros((0, 3000))], [RNG.standard_normal((2, 3000))]))
    assert spectrum is not None
    assert frequency_response(spectrum) is None
    assert mean_density(spectrum).sum() == pytest.approx(1.0)  # by construction: each density over its total


def test_segments_with_missing_samples_are_left_out():
    y = RNG.standard_normal((1, 8192))
    holed = y.copy()
    holed[0, 4000] = np.nan
    part = spectra(recording(["ambient"], [np.zeros((0, 8192))], [holed]), n_segment=512)
    full = spectra(recording(["ambient"], [np.zeros((0, 8192))], [y]), n_segment=512)
    assert np.isfinite(part.output_density).all()
    assert full.n_averages - part.n_averages == 2  # half overlap: each sample lies in two segments
    assert spectra(recording(["ambient"], [np.zeros((0, 600))], [np.full((1, 600), np.nan)])) is None


def test_remainder_tells_whether_a_transient_died_down():
    t = np.arange(1000) / 100.0
    y = np.exp(-0.5 * t)[None]
    spectrum = spectra(recording(["free_decay"], [np.zeros((0, 1000))], [y]))
    assert spectrum.remainder == pytest.approx(np.exp(-0.5 * 9.0), rel=0.01)  # nine tenths of 10 s later


def test_inputs_that_no_record_has_are_not_measured():
    channels = (Channel("f", "N"),), (Channel("y", "m"),)
    y = np.zeros((1, 10))
    silent = Recording((Record("ambient", np.zeros((0, 10)), y),), *channels, 1.0)
    assert measured_inputs(silent) == ()
    driven = Recording((Record("random", y, y), Record("ambient", np.zeros((0, 10)), y)), *channels, 1.0)
    assert measured_inputs(driven) == channels[0]


def test_frequency_axis_ends_above_the_highest_mode():
    assert upper_frequency(100.0, np.array([1.0, 10.0])) == 15.0
    assert upper_frequency(100.0, np.array([45.0])) == 50.0
    assert upper_frequency(100.0, np.zeros(0)) == 50.0


def test_coherence_of_one_input_is_that_of_scipy():
    u = RNG.standard_normal((1, 4096))
    y = np.stack([np.convolve(u[0], [1.0, 0.5])[:4096] + RNG.standard_normal(4096), np.zeros(4096)])
    spectrum = spectra(recording(["random"], [u], [y]), n_segment=256)
    found = coherence(spectrum)
    n = 2 * (spectrum.frequency_hz.size - 1)
    _, expected = scipy.signal.coherence(u[0], y[0], 100.0, "hann", n, detrend="constant")
    np.testing.assert_allclose(found[0, 1:], expected[1:], rtol=1e-9)  # the same sums in another order
    assert np.isnan(found[1]).all()  # a dead channel


def test_two_inputs_explain_what_either_alone_does_not():
    u = RNG.standard_normal((2, 8192))
    y = (u[0] + u[1])[None]
    both = coherence(spectra(recording(["random"], [u], [y]), n_segment=512))
    np.testing.assert_allclose(both[0, 1:-1], 1.0, rtol=1e-9)  # exact but for rounding
    one = coherence(spectra(recording(["random"], [u[:1]], [y]), n_segment=512))
    assert 0.3 < np.mean(one[0, 1:-1]) < 0.7


def test_coherence_needs_more_averages_than_inputs():
    u = RNG.standard_normal((2, 600))
    few = spectra(recording(["random"], [u], [u[:1]]), n_segment=512)
    assert few.n_averages < 4
    assert coherence(few) is None
    assert coherence(spectra(recording(["ambient"], [u[:0]], [u]))) is None
