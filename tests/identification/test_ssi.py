"""SSI-cov on chains whose truth is known: rates, properties, the peers' defects, and advice for bad requests."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification import output_only
from identification.covariance import output_covariances
from identification.errors import IdentificationError, OrderError, RecordingError, TooShortError
from identification.hankel import block_hankel, shift_invariance
from identification.modes import mac
from identification.output_only import horizon_warning, leading_subspace
from identification.recording import Channel, Recording
from identification.ssi import ssi_cov
from identification.systems import StateSpace
from tests.ambient import DT, ambient, output_record
from tests.systems import chain7

TRUTH = chain7().modes()


def damping_errors(modes):
    return modes.damping_ratio / TRUTH.damping_ratio - 1


def test_the_error_falls_with_the_root_of_the_number_of_samples():
    def rms_errors(n_samples):
        """Over the least standard deviations of Au (2014), which fall with the root: (ζ/2πN)^½ and (2πζN)^-½."""
        periods = n_samples * DT * TRUTH.frequency_hz
        least = np.sqrt([TRUTH.damping_ratio, 1 / TRUTH.damping_ratio]) / np.sqrt(2 * np.pi * periods)
        errors = []
        for seed in range(3):
            modes = ssi_cov(ambient(n_samples, seed), order=14, n_rows=10).system.modes()
            errors.append([modes.frequency_hz / TRUTH.frequency_hz - 1, damping_errors(modes)] / least)
        return np.sqrt(np.mean(np.square(errors), axis=(0, 2)))

    few, many = rms_errors(10_000), rms_errors(90_000)
    # An RMS over 21 errors scatters by 15 %. Modes overlap, so that the errors are above the least ones.
    assert np.all((few / many > 0.6) & (few / many < 1.7))
    assert np.all(many < 3)


def test_all_seven_modes_of_a_long_record():
    modes = ssi_cov(ambient(80_000, 0), order=14).system.modes()
    # A frequency is known to about (ζ / 2 π N)^½ with N periods recorded, Au (2014): 0.1 % for all modes here.
    np.testing.assert_allclose(modes.frequency_hz, TRUTH.frequency_hz, rtol=5e-3)
    # A damping ratio to about (2 π ζ N)^-½: 9 % for the first mode, less for the others.
    np.testing.assert_allclose(modes.damping_ratio, TRUTH.damping_ratio, rtol=0.25)
    assert np.all(np.diag(mac(modes.shapes, TRUTH.shapes)) > 0.98)


def test_a_single_reference_finds_the_strong_modes():
    realization = ssi_cov(ambient(40_000, 1), order=14, references=["acceleration_x7"])
    assert realization.settings["n_references"] == 1
    frequency_hz = realization.system.modes().frequency_hz
    for f in TRUTH.frequency_hz[:4]:
        assert np.min(np.abs(frequency_hz / f - 1)) < 0.01


def test_measurement_noise_stays_out_with_lag_zero():
    recording = ambient(100_000, 2, noise=0.5)
    n_rows = 10

    def realized(first_lag):
        R = output_covariances(recording, 2 * n_rows - 1, first_lag=first_lag)
        U, s = leading_subspace(block_hankel(R, n_rows, n_rows), 14)
        ((A, C),) = shift_invariance(U, s, n_outputs=7, orders=[14])
        return StateSpace(A, np.zeros((14, 0)), C, np.zeros((7, 0)), DT, (), recording.outputs).modes()

    modes = ssi_cov(recording, order=14, n_rows=n_rows).system.modes()
    np.testing.assert_allclose(modes.poles, realized(1).poles, rtol=1e-6)
    # At this length and noise a damping ratio scatters by about 10 %, so their mean error is a few per cent ...
    assert abs(np.mean(damping_errors(modes))) < 0.1
    # ... while the variance of the noise at lag zero spoils it.
    assert np.max(np.abs(damping_errors(realized(0)))) > 0.5


@given(seed=st.integers(0, 20), order=st.permutations(range(7)))
@settings(max_examples=10)
def test_follows_the_order_of_the_channels(seed, order):
    recording = ambient(2_000, seed)
    names = [recording.outputs[i].name for i in order]
    modes = ssi_cov(recording, order=8, n_rows=12).system.modes()
    permuted = ssi_cov(recording.select(outputs=names), order=8, n_rows=12).system.modes()
    # Rounding errors of 1e-16 grow with the square of the ratio of singular values, here some 1e3.
    np.testing.assert_allclose(permuted.frequency_hz, modes.frequency_hz, rtol=1e-7)
    np.testing.assert_allclose(permuted.damping_ratio, modes.damping_ratio, rtol=1e-5, atol=1e-9)
    assert np.all(np.diag(mac(permuted.shapes, modes.shapes[list(order)])) > 1 - 1e-8)


@given(exponent=st.integers(-6, 6))
@settings(max_examples=8)
def test_ignores_the_units_of_the_channels(exponent):
    """Readings of one kind in larger numbers change the shapes by as much, and no pole."""
    positions, accelerations = ambient(3_000, 3, quantity="displacement"), ambient(3_000, 3)
    both = np.vstack([positions.records[0].outputs[:3], accelerations.records[0].outputs[3:]])
    channels = (*positions.outputs[:3], *accelerations.outputs[3:])
    scale = np.r_[np.full(3, 10.0**exponent), np.ones(4)][:, None]

    def modes_of(y):
        recording = Recording((output_record(y),), (), channels, 1 / DT)
        return ssi_cov(recording, order=10, n_rows=12).system.modes()

    modes, scaled = modes_of(both), modes_of(both * scale)
    # The scale is taken off before anything else, to rounding errors.
    np.testing.assert_allclose(scaled.frequency_hz, modes.frequency_hz, rtol=1e-8)
    assert np.all(np.diag(mac(scaled.shapes / scale, modes.shapes)) > 1 - 1e-7)


def test_a_sweep_gives_each_order_as_if_alone():
    recording = ambient(4_000, 4)
    swept = ssi_cov(recording, orders=range(2, 21, 2), n_rows=12)
    assert swept.orders == tuple(range(2, 21, 2))
    alone = ssi_cov(recording, order=12, n_rows=12).system
    np.testing.assert_allclose(swept.at(12).modes().poles, alone.modes().poles, rtol=1e-7)


def test_several_records_count_as_one_measurement():
    recording = ambient([9_000, 4_000, 7_000], 5)
    modes = ssi_cov(recording, order=14, n_rows=10).system.modes()
    # As for one record of 20 000 samples, three times the scatter of 0.1 to 0.2 %.
    np.testing.assert_allclose(modes.frequency_hz, TRUTH.frequency_hz, rtol=1e-2)


def test_thinning_the_past_keeps_the_modes(monkeypatch):
    recording = ambient(40_000, 6, dt=DT / 4)
    full = ssi_cov(recording, order=14, n_rows=80)
    monkeypatch.setattr(output_only, "MAX_COLUMNS", 140)
    thin = ssi_cov(recording, order=14, n_rows=80)
    assert (full.settings["stride"], thin.settings["stride"]) == (1, 4)
    # Both within the scatter of the data of some 0.3 %.
    for realization in (full, thin):
        np.testing.assert_allclose(realization.system.modes().frequency_hz, TRUTH.frequency_hz, rtol=0.02)


@pytest.mark.parametrize("shape", [(60, 40), (40, 60)])
def test_leading_subspace_of_noise_is_that_of_the_decomposition(shape):
    H = np.random.default_rng(7).standard_normal(shape)
    U, s = leading_subspace(H, 5)
    expected, values, _ = np.linalg.svd(H)
    np.testing.assert_allclose(s, values[:5], rtol=1e-12)
    # The gaps between these singular values are a few per cent, so vectors turn by some 1e-14.
    np.testing.assert_allclose(np.abs(np.sum(U * expected[:, :5], axis=0)), 1, atol=1e-12)


def test_leading_subspace_of_exact_data_keeps_the_small_values():
    """Singular values down to 1e-12, of which a squared matrix would know those above 1e-8 only."""
    rng = np.random.default_rng(8)
    P, Q = (np.linalg.qr(rng.standard_normal((50, 7)))[0] for _ in range(2))
    values = 10.0 ** -np.arange(0, 14, 2)
    U, s = leading_subspace(P * values @ Q.T, 7)
    np.testing.assert_allclose(s, values, atol=1e-15)
    # A vector turns by the rounding error of the largest value, 1e-16, over its own value.
    np.testing.assert_allclose(1 - np.abs(np.sum(U * P, axis=0)), 0, atol=1e-7)


def test_the_horizon_is_chosen_and_explained():
    realization = ssi_cov(ambient(20_000, 9))
    # Two thirds of a period of 1.66 Hz are 14.8 samples; the bin of the peak may be 0.02 Hz off.
    assert realization.settings["n_rows"] == 15
    assert any("two thirds of a period of the lowest resonance peak" in note for note in realization.notes)
    assert any("resonance peaks" in note for note in realization.notes)


def test_too_short_a_horizon_is_noted():
    realization = ssi_cov(ambient(20_000, 10), order=14, n_rows=5)
    assert any("less than half a period of the mode at 1.6" in note for note in realization.notes)
    assert not horizon_warning(TRUTH, ssi_cov(ambient(20_000, 10), order=14, n_rows=12))


def test_a_default_sweep_fits_short_records_and_short_horizons():
    assert ssi_cov(ambient(400, 11)).orders[-1] <= 40
    assert ssi_cov(ambient(60, 11)).orders == (2, 4, 6)
    assert ssi_cov(ambient(2_000, 11), n_rows=3, references=["acceleration_x1"]).orders == (2,)


@pytest.mark.parametrize(
    ("request_", "error", "says"),
    [
        ({"order": 50, "n_rows": 4}, OrderError, r"exceeds 21, the most that 4 block rows of 7 outputs"),
        ({"order": 0}, OrderError, "from 1 on"),
        ({"orders": []}, OrderError, "from 1 on"),
        ({"order": 4, "n_rows": 1}, IdentificationError, "at least 2"),
        ({"order": 4, "n_rows": 400}, TooShortError, "fewer block rows"),
        ({"order": 4, "references": ["x9"]}, RecordingError, "x9"),
    ],
)
def test_impossible_requests_are_told(request_, error, says):
    with pytest.raises(error, match=says):
        ssi_cov(ambient(500, 12), **request_)


def test_more_states_than_the_data_have_are_told():
    t = np.arange(1000) * 0.01
    decay = np.exp(-0.1 * t) * np.sin(20 * t)
    silent = Recording((output_record(0 * decay[None]),), (), (Channel("a", "m/s^2"),), 100.0)
    with pytest.raises(OrderError, match=r"exceeds 0, the numerical rank .* check the channels"):
        ssi_cov(silent)


def test_a_missing_sample_is_named():
    recording = ambient(1_000, 13)
    y = np.array(recording.records[0].outputs)
    y[3, 500] = np.inf
    with pytest.raises(RecordingError, match="acceleration_x4"):
        ssi_cov(replace(recording, records=(output_record(y),)))
