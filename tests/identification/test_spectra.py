"""Spectra and frequency responses against exact responses, textbook formulas and plain loops."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from identification import segments
from identification.covariance import output_covariances
from identification.errors import IdentificationError, RecordingError, TooShortError
from identification.estimators import ESTIMATORS
from identification.recording import Channel, Record, Recording
from identification.segments import choose_segments, find_period
from identification.spectra import cross_spectra, frequency_response, positive_spectra, unit_sizes
from tests import systems

CHAIN3 = systems.paper_chain3("coupled")
FORCE, MOTION = (Channel("u", "N"),), (Channel("y", "m/s^2"),)


def relative_error(response, system):
    H = system.frequency_response(response.frequency_hz)
    return np.max(np.abs(response.values - H)) / np.max(np.abs(H))


def multisines(system, period, n_periods, n_records, seed):
    """Steady sines on all lines below half the sample rate but zero, with random phases."""
    rng = np.random.default_rng(seed)
    inputs = []
    for _ in range(n_records):
        phases = rng.uniform(0, 2 * np.pi, (len(system.inputs), period // 2 + 1))
        spectrum = np.exp(1j * phases)
        spectrum[:, [0, -1]] = 0
        inputs.append(np.tile(np.fft.irfft(spectrum, period), (1, n_periods)))
    return systems.recorded(system, inputs, kind="multisine")


def with_noise(recording, rms, rng, side="outputs"):
    records = []
    for record in recording.records:
        clean = getattr(record, side)
        records.append(replace(record, **{side: clean + rms * rng.standard_normal(clean.shape)}))
    return replace(recording, records=tuple(records))


# --- Without leakage


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("n_outputs", [1, 2])
def test_pulse_records_that_ring_down_give_the_exact_response(estimator, n_outputs):
    # The slowest mode decays with 0.08 / s, so that exp(-0.08 * 400) = 1e-14 is left at the end.
    recording = systems.pulse_recording(CHAIN3, 8000)
    names = [channel.name for channel in recording.outputs[:n_outputs]]
    response = frequency_response(recording.select(outputs=names), estimator)
    assert response.frequency_hz.size == 4000  # but for 0 Hz, which an offset of the sensor would reach
    H = CHAIN3.frequency_response(response.frequency_hz)[:, :n_outputs]
    np.testing.assert_allclose(response.values, H, atol=1e-12 * np.abs(H).max())
    assert response.coherence is None  # two records for two inputs leave nothing to compare
    assert response.variance is None


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_periodic_records_give_the_exact_response_on_their_lines(estimator):
    # After the first period of 400 s the start is forgotten to 1e-14.
    recording = multisines(CHAIN3, 8000, 3, 2, 1)
    response = frequency_response(recording, estimator)
    assert response.frequency_hz.size == 3999
    # The condition of two random phases per line, up to a few thousand, counts squared.
    assert relative_error(response, CHAIN3) < 1e-7
    assert "repeat after 8000 samples" in response.notes[0]


def test_bursts_that_ring_down_give_the_exact_response():
    rng = np.random.default_rng(2)
    inputs = []
    for _ in range(3):
        u = np.zeros((2, 8000))
        u[:, :400] = rng.standard_normal((2, 400))
        inputs.append(u)
    response = frequency_response(systems.recorded(CHAIN3, inputs, kind="burst_random"))
    # Three bursts determine two inputs to a condition of some hundreds, squared in the moments.
    assert relative_error(response, CHAIN3) < 1e-8
    np.testing.assert_allclose(response.coherence, 1, atol=1e-8)


def test_records_of_different_length_are_followed_by_zeros():
    recording = systems.pulse_recording(CHAIN3, 8000)
    short = replace(recording.records[0], inputs=recording.records[0].inputs[:, :7500],
                    outputs=recording.records[0].outputs[:, :7500])  # fmt: skip
    response = frequency_response(replace(recording, records=(short, recording.records[1])))
    assert relative_error(response, CHAIN3) < 1e-12


def test_an_exponential_window_shifts_every_pole_by_its_rate():
    decay, n = 0.2, 2000
    response = frequency_response(systems.pulse_recording(CHAIN3, n), decay=decay)
    fall = np.exp(-decay * CHAIN3.dt)
    shifted = replace(CHAIN3, A=fall * CHAIN3.A, B=fall * CHAIN3.B)
    # What the record leaves out: exp(-(0.08 + 0.2) * 100) = 1e-12.
    assert relative_error(response, shifted) < 1e-11
    assert response.decay == decay


def test_leakage_under_the_hann_window_is_that_of_its_lag_window():
    # Under white forces the pieces see the pulse response multiplied by the window's own correlation.
    rng = np.random.default_rng(5)
    system = replace(CHAIN3, B=CHAIN3.B[:, :1], D=CHAIN3.D[:, :1], inputs=CHAIN3.inputs[:1])
    recording = systems.recorded(system, [rng.standard_normal((1, 200_000))])
    n = 512
    response = frequency_response(recording, n_segment=n)
    h = system.markov(n).values * cross_spectra(recording, n_segment=n).lag_window()[:, None, None]
    seen = np.fft.rfft(h, axis=0)[2:]
    exact = system.frequency_response(response.frequency_hz)
    share = np.vdot(seen - exact, response.values - exact).real / np.linalg.norm(seen - exact) ** 2
    # 760 averages leave a scatter of a few per cent of the leakage, which is 20 % at the first resonance.
    assert share == pytest.approx(1, abs=0.1)
    assert np.max(np.abs(seen - exact)) > 0.1 * np.max(np.abs(exact))


# --- With noise


def test_the_error_falls_with_the_root_of_the_number_of_averages():
    errors = []
    for n_runs in (4, 64):
        rng = np.random.default_rng(7)
        base = systems.pulse_recording(CHAIN3, 800)
        recording = with_noise(replace(base, records=base.records * n_runs), 0.02, rng)
        response = frequency_response(recording, decay=0.05)
        exact = frequency_response(base, decay=0.05)
        errors.append(np.sqrt(np.mean(np.abs(response.values - exact.values) ** 2)))
    # Mean of 1600 complex numbers: known to 2 %.
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.08)


@pytest.mark.parametrize("kind", ["transient", "stationary"])
def test_the_variance_is_the_one_that_the_errors_have(kind):
    rng = np.random.default_rng(8)
    if kind == "transient":
        base = systems.pulse_recording(CHAIN3, 800)
        recording = with_noise(replace(base, records=base.records * 10), 0.02, rng)
        response = frequency_response(recording)
        exact = frequency_response(base).values
    else:
        # No dynamics, so that nothing leaks: y = G u + noise.
        G = np.array([[1.0, -2.0], [0.5, 3.0]])
        u = rng.standard_normal((2, 40_000))
        base = Recording((Record("random", u, G @ u),), CHAIN3.inputs, CHAIN3.outputs, 20.0)
        response = frequency_response(with_noise(base, 0.5, rng), n_segment=1600)
        exact = G
    ratio = np.mean(np.abs(response.values - exact) ** 2) / np.mean(response.variance)
    # Some thousand squared errors, of which neighbours under the window are related: 5 %.
    assert ratio == pytest.approx(1, abs=0.15)


def test_h1_stands_noise_on_the_output_and_h2_noise_on_the_input():
    # One input, so that the textbook gives the bias: H1 falls by 1 / (1 + noise / signal) of the input power.
    rng = np.random.default_rng(9)
    u = rng.standard_normal((1, 400_000))
    clean = Recording((Record("random", u, 3.0 * u),), FORCE, MOTION, 100.0)
    noisy_output = with_noise(clean, 3.0, rng)
    noisy_input = with_noise(clean, 1.0, rng, "inputs")

    def mean(recording, estimator):
        return np.mean(frequency_response(recording, estimator, n_segment=256).values.real)

    # 400 000 samples: a relative scatter of 0.2 %.
    assert mean(noisy_output, "H1") == pytest.approx(3.0, rel=0.01)
    assert mean(noisy_output, "H2") == pytest.approx(3.0 * 2, rel=0.01)
    assert mean(noisy_input, "H1") == pytest.approx(3.0 / 2, rel=0.01)
    assert mean(noisy_input, "H2") == pytest.approx(3.0, rel=0.01)
    both = with_noise(noisy_input, 3.0, rng)
    assert mean(both, "Hv") == pytest.approx(3.0, rel=0.01)


def test_one_input_reduces_to_the_textbook():
    rng = np.random.default_rng(10)
    u = rng.standard_normal((1, 6000))
    y = scipy.signal.lfilter([1.0, 0.3], [1.0, -0.5], u) + 0.5 * rng.standard_normal((1, 6000))
    recording = Recording((Record("random", u, y),), FORCE, MOTION, 50.0)
    found = {name: frequency_response(recording, name, n_segment=256).values[:, 0, 0] for name in ESTIMATORS}
    settings = {"fs": 50.0, "window": "hann", "nperseg": 256, "detrend": "constant"}
    uu, yy = (scipy.signal.welch(x[0], **settings)[1][2:] for x in (u, y))
    uy = scipy.signal.csd(u[0], y[0], **settings)[1][2:]
    np.testing.assert_allclose(found["H1"], uy / uu, rtol=1e-10)
    np.testing.assert_allclose(found["H2"], yy / uy.conj(), rtol=1e-10)
    np.testing.assert_allclose(found["Hv"], np.sqrt(yy / uu) * np.exp(1j * np.angle(uy)), rtol=1e-10)
    coherence = frequency_response(recording, n_segment=256).coherence[:, 0]
    np.testing.assert_allclose(coherence, np.abs(uy) ** 2 / uu / yy, rtol=1e-10)


def test_coherence_is_the_share_of_the_power_that_the_inputs_explain():
    rng = np.random.default_rng(11)
    u = rng.standard_normal((2, 200_000))
    signal = np.array([[1.0, 2.0]]) @ u  # power 5
    noise = np.sqrt(5.0) * rng.standard_normal(signal.shape)
    recording = Recording((Record("random", u, signal + noise),), CHAIN3.inputs, MOTION, 10.0)
    response = frequency_response(recording, n_segment=512)
    # Half; 770 averages raise the mean by 1 / 770, and 255 lines leave a scatter of 0.2 %.
    assert np.mean(response.coherence) == pytest.approx(0.5, abs=0.01)


@settings(max_examples=10)
@given(
    st.permutations(range(2)),
    st.permutations(range(2)),
    st.lists(st.floats(1e-3, 1e3), min_size=4, max_size=4),
)
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_responses_follow_channels_and_units(estimator, rows, columns, units):
    rng = np.random.default_rng(12)
    record = systems.recorded(CHAIN3, [rng.standard_normal((2, 3000))]).records[0]
    recording = with_noise(
        Recording((record,), CHAIN3.inputs, CHAIN3.outputs, 20.0), 0.1, np.random.default_rng(1)
    )
    out, into = np.array(units[:2]), np.array(units[2:])
    record = recording.records[0]
    moved = replace(
        recording,
        records=(
            replace(
                record,
                inputs=(into[:, None] * record.inputs)[columns],
                outputs=(out[:, None] * record.outputs)[rows],
            ),
        ),
    )
    a = frequency_response(recording, estimator).values * out[:, None] / into
    b = frequency_response(moved, estimator).values
    np.testing.assert_allclose(b, a[:, rows][:, :, columns], atol=1e-8 * np.abs(a).max())


# --- How records are cut


@settings(max_examples=25)
@given(st.integers(40, 200), st.integers(2, 6), st.integers(0, 30), st.floats(0, 0.1), st.integers(0, 99))
def test_the_period_is_found_under_noise(period, n_periods, extra, noise, seed):
    rng = np.random.default_rng(seed)
    spectrum = np.exp(2j * np.pi * rng.random(period // 2 + 1))
    spectrum[0] = 0
    one = np.fft.irfft(spectrum, period)
    one /= np.std(one)
    u = np.tile(one, n_periods + 1)[: n_periods * period + min(extra, period - 1)]
    u = u + noise * rng.standard_normal(u.size)
    assert find_period(Record("multisine", u[None], u[None])) == period


def test_noise_and_silence_have_no_period():
    u = np.random.default_rng(0).standard_normal((1, 500))
    assert find_period(Record("multisine", u, u)) is None
    assert find_period(Record("multisine", 0 * u, u)) is None
    assert find_period(Record("ambient", np.zeros((0, 500)), u)) is None


def test_too_few_records_for_the_inputs_are_treated_as_random():
    response = frequency_response(multisines(CHAIN3, 400, 6, 1, 3), n_segment=None)
    assert "1 records do not tell 2 inputs apart" in response.notes[0]


def test_batches_give_what_the_whole_gives(monkeypatch):
    rng = np.random.default_rng(13)
    recording = systems.recorded(CHAIN3, [rng.standard_normal((2, n)) for n in (900, 2000, 200)])
    whole = frequency_response(recording, n_segment=256)
    spectra = cross_spectra(recording, n_segment=256)
    monkeypatch.setattr(segments, "BATCH", 1)
    np.testing.assert_allclose(frequency_response(recording, n_segment=256).values, whole.values, rtol=1e-10)
    np.testing.assert_allclose(cross_spectra(recording, n_segment=256).values, spectra.values, atol=1e-14)


def test_independent_pieces_are_counted_as_welch_does():
    recording = Recording((Record("random", np.zeros((1, 2560)), np.zeros((1, 2560))),), FORCE, MOTION, 1.0)
    found = choose_segments(recording, n_segment=256)
    K = len(found.starts[0])
    assert K == 19
    # Welch (1967): for the Hann window at half overlap the variance of K pieces is (1 + 2 (1 - 1/K) / 36) / K.
    assert found.n_averages == pytest.approx(K / (1 + 2 * (1 - 1 / K) / 36), rel=1e-3)


# --- Outputs alone


def test_cross_spectra_are_those_of_scipy():
    rng = np.random.default_rng(14)
    y = rng.standard_normal((3, 3), ) @ rng.standard_normal((3, 4000))  # fmt: skip
    channels = tuple(Channel(f"y{i}", "m/s^2") for i in range(3))
    recording = Recording((Record("ambient", np.zeros((0, 4000)), y),), (), channels, 40.0)
    found = cross_spectra(recording, n_segment=200, zero_padding=2)
    f, expected = scipy.signal.csd(
        y[:, None], y[None], fs=40.0, window="hann", nperseg=200, nfft=400, detrend="constant"
    )
    np.testing.assert_allclose(found.frequency_hz, f, rtol=1e-14)
    # scipy conjugates the first signal; G = E[Y Yᴴ] conjugates the second.
    np.testing.assert_allclose(found.values, np.moveaxis(expected, -1, 0).transpose(0, 2, 1), atol=1e-14)
    window = np.sin(np.pi * np.arange(200) / 200) ** 2
    direct = np.correlate(window, window, "full")[199:] / np.sum(window**2)
    np.testing.assert_allclose(found.lag_window(), direct, atol=1e-14)


def test_positive_spectra_are_transforms_of_the_covariances():
    rng = np.random.default_rng(15)
    y = rng.standard_normal((2, 3000))
    channels = (Channel("a", "m"), Channel("b", "m"))
    recording = Recording((Record("ambient", np.zeros((0, 3000)), y),), (), channels, 10.0)
    found = positive_spectra(recording, 64, references=["b"], decay=0.7)
    R = output_covariances(recording, 64, references=["b"], first_lag=0)
    for line, f in enumerate(found.frequency_hz):
        z = np.exp(2j * np.pi * f * 0.1)
        direct = R[0] / 2 + sum(R[k] * np.exp(-0.07 * k) * z**-k for k in range(1, 64))
        np.testing.assert_allclose(found.values[line], direct, atol=1e-13)
    assert found.inputs == (channels[1],)


def test_sizes_are_shared_by_the_channels_of_a_unit():
    channels = (Channel("a", "m"), Channel("b", "m/s^2"), Channel("c", "m"), Channel("d", "V"))
    np.testing.assert_allclose(unit_sizes(np.array([1.0, 100.0, 7.0, 0.0]), channels), [2, 10, 2, 1])


# --- What cannot be done


def test_lines_without_force_are_left_out():
    # A force whose spectrum 1 + z⁻² vanishes at a quarter of the sample rate.
    u = np.zeros((1, 400))
    u[0, [0, 2]] = 1
    recording = Recording((Record("impact", u, 2 * u),), FORCE, MOTION, 100.0)
    response = frequency_response(recording)
    assert 25.0 not in response.frequency_hz
    assert response.frequency_hz.size == 199
    np.testing.assert_allclose(response.values, 2, atol=1e-12)
    assert response.weight[98] < 0.02 * response.weight[0]


def test_an_output_that_does_not_move_has_no_response():
    recording = systems.pulse_recording(CHAIN3, 500)
    still = [
        replace(record, outputs=record.outputs * np.array([[1.0], [0.0]])) for record in recording.records
    ]
    for estimator in ESTIMATORS:
        response = frequency_response(replace(recording, records=tuple(still)), estimator)
        np.testing.assert_array_equal(response.values[:, 1], 0)


def test_inputs_that_are_copies_are_refused():
    rng = np.random.default_rng(16)
    u = np.tile(rng.standard_normal((1, 4000)), (2, 1))
    with pytest.raises(RecordingError, match="2 inputs nowhere act independently"):
        frequency_response(systems.recorded(CHAIN3, [u]))


def test_other_requests_that_cannot_be_met():
    pulses = systems.pulse_recording(CHAIN3, 500)
    ambient = replace(
        pulses, inputs=(), records=tuple(replace(r, inputs=np.zeros((0, 500))) for r in pulses.records)
    )
    random = systems.recorded(CHAIN3, [np.ones((2, 500))])
    with pytest.raises(IdentificationError, match="'H3' is unknown; expected one of H1, H2, Hv"):
        frequency_response(pulses, "H3")
    with pytest.raises(RecordingError, match="needs measured inputs"):
        frequency_response(ambient)
    with pytest.raises(IdentificationError, match="exponential window suits transient records"):
        frequency_response(random, decay=1.0)
    with pytest.raises(TooShortError, match="600 samples were asked for and the longest record has 500"):
        frequency_response(random, n_segment=600)
    with pytest.raises(TooShortError, match="at least 2"):
        positive_spectra(ambient, 1)
    with pytest.raises(IdentificationError, match="no line lies between 30 and 40 Hz"):
        frequency_response(pulses).between(30, 40)


@pytest.mark.parametrize("transform", [frequency_response, cross_spectra])
def test_a_missing_sample_is_named(transform):
    recording = systems.recorded(CHAIN3, [np.random.default_rng(0).standard_normal((2, 500))])
    outputs = np.array(recording.records[0].outputs)
    outputs[1, 100] = np.nan
    broken = replace(recording, records=(replace(recording.records[0], outputs=outputs),))
    with pytest.raises(RecordingError, match=r"'acceleration_x3' of record 0 misses a sample at t = 5 s"):
        transform(broken)
