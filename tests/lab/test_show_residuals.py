"""What predictions leave: errors of known size, and a disturbance hidden where only its maker knows."""

from dataclasses import replace

import numpy as np
import pytest

from lab.show.residuals import (
    MODELS,
    leftover,
    levels,
    relative_errors,
    residual_spectra,
    shown_models,
    signal_rms,
)
from tests.lab.diagnosed import (
    CALIBRATED,
    FIRST_HELD_OUT,
    NOISE,
    NOMINAL,
    RATE,
    explained,
    recorded,
    two_masses,
)


@pytest.fixture(scope="module")
def recording():
    return recorded(two_masses())


@pytest.fixture(scope="module")
def diagnosis(recording):
    return explained(two_masses(), recording)


def with_extended(diagnosis, change):
    """The diagnosis whose extended model leaves what `change` says, given record number and measured outputs."""
    made = [
        replace(p, extended=p.measured - change(i, p.measured)) for i, p in enumerate(diagnosis.predictions)
    ]
    return replace(diagnosis, predictions=tuple(made))


def test_errors_are_those_that_were_made(diagnosis):
    kept = [p.measured[:, FIRST_HELD_OUT:] for p in diagnosis.predictions]
    signal = np.sqrt(np.mean([np.mean(y**2, axis=1) for y in kept], axis=0))
    made = np.sqrt(np.mean([p.measured.var(axis=1) for p in diagnosis.predictions], axis=0))
    for model, size in zip(MODELS, (NOMINAL, CALIBRATED, NOISE), strict=True):
        # The RMS of 720 white samples scatters by 1 / √1440; four standard deviations are 11 %.
        np.testing.assert_allclose(relative_errors(diagnosis, model), size * made / signal, rtol=0.11)


def test_only_samples_kept_aside_count(diagnosis):
    def early(_, y):
        e = np.zeros_like(y)
        e[:, :FIRST_HELD_OUT] = 100.0
        return e

    np.testing.assert_array_equal(relative_errors(with_extended(diagnosis, early), "extended"), 0.0)


def test_where_most_is_left(diagnosis, recording):
    """Seven cycles a second in the second channel of the second record, from 18 s to 19 s."""
    rms = signal_rms(diagnosis)[1]

    def burst(record, y):
        time = np.arange(y.shape[1]) / RATE
        e = np.zeros_like(y)
        if record == 1:
            e[1] = 0.5 * rms * np.sin(2 * np.pi * 7.0 * time) * ((time >= 18) & (time < 19))
        return e

    left = leftover(with_extended(diagnosis, burst), recording)
    assert (left.channel, left.record) == ("pos1", 1)
    assert left.time[0] < 19
    assert left.time[1] > 18
    # A burst of one second blurs a line by half a hertz.
    assert left.frequency_hz == pytest.approx(7.0, abs=0.5)


def test_an_error_that_grows_with_the_motion_is_told(diagnosis, recording):
    """An error in proportion to the signal is as many times larger as the signal is."""
    left = leftover(with_extended(diagnosis, lambda _, y: 0.1 * y), recording)
    row = [channel.name for channel in recording.outputs].index(left.channel)
    size = 40  # 2400 samples in 60 stretches
    stretches = [
        np.sqrt(np.mean(p.measured[row, k : k + size] ** 2))
        for p in diagnosis.predictions
        for k in range(0, 1200, size)
    ]
    calm, lively = np.sort(stretches)[:15], np.sort(stretches)[-15:]
    expected = np.sqrt(np.mean(lively**2) / np.mean(calm**2))
    assert left.growth == pytest.approx(expected, rel=1e-9)
    assert left.error == pytest.approx(0.1, rel=1e-9)
    silent = leftover(with_extended(diagnosis, lambda _, y: 0 * y), recording)
    assert (silent.error, silent.growth) == (0.0, 1.0)


def test_levels_are_those_of_a_plain_loop(diagnosis):
    parts = levels(diagnosis, RATE)
    assert len(parts) == 2
    p = diagnosis.predictions[1]
    for k in (0, 7, 29):
        part = slice(40 * k, 40 * k + 40)
        expected = [np.sqrt(np.mean((p.measured - p.nominal)[row, part] ** 2)) for row in (0, 1)]
        np.testing.assert_allclose(parts[1].residual["nominal"][:, k], expected, rtol=1e-12)
        assert parts[1].time[k] == pytest.approx((40 * k + 20) / RATE, rel=1e-12)


def test_missing_samples_are_left_out(diagnosis, recording):
    def holed(p):
        measured = np.array(p.measured)
        measured[0, :100] = np.nan
        measured[1, 845] = np.nan
        return replace(p, measured=measured)

    gappy = replace(diagnosis, predictions=tuple(holed(p) for p in diagnosis.predictions))
    first = levels(gappy, RATE)[0]
    assert np.all(np.isnan(first.measured[0, :2]))
    assert np.isfinite(first.measured[0, 3:]).all()
    # One sample of 720 changes an RMS by less than a percent unless it is ten times the RMS.
    np.testing.assert_allclose(
        relative_errors(gappy, "nominal"), relative_errors(diagnosis, "nominal"), rtol=0.01
    )
    assert np.isfinite(leftover(gappy, recording).error)


def test_the_density_of_white_noise_is_flat_at_its_variance(diagnosis, recording):
    spectrum = residual_spectra(diagnosis, recording, "nominal")
    variance = (NOMINAL * signal_rms(diagnosis)) ** 2
    total = spectrum.output_density.sum(axis=1) * spectrum.frequency_hz[1]
    # Variance of 2400 white samples: 3 % at one standard deviation.
    np.testing.assert_allclose(total, variance, rtol=0.12)


def test_without_findings_the_extended_model_is_the_calibrated_one(diagnosis):
    assert shown_models(diagnosis) == MODELS
    assert shown_models(replace(diagnosis, findings=())) == ("nominal", "calibrated")
