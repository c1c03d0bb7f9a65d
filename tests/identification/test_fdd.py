"""Frequency domain decomposition: expected spectra of known oscillators, then recordings of known structures."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.bells import Bell, bell_pole, find_bells
from identification.errors import IdentificationError, OrderError
from identification.fdd import efdd, fdd
from identification.modes import mac
from identification.peaks import find_peaks
from identification.recording import Channel, Record, Recording
from tests import systems

DT = 0.02


def expected_spectrum(frequency_hz, damping, n, *, window=True):
    """Mean power spectrum of the displacement of an oscillator under white force, seen through Hann pieces.

    The transform of its correlation times the correlation of the window, on the lines of pieces with as many
    zeros as samples.
    """
    omega, k = 2 * np.pi * frequency_hz, np.arange(n)
    damped = omega * np.sqrt(1 - damping**2)
    tau = DT * k
    R = np.exp(-damping * omega * tau) * (
        np.cos(damped * tau) + damping / np.sqrt(1 - damping**2) * np.sin(damped * tau)
    )
    R = R * lag_window(n) if window else R
    return 2 * np.fft.rfft(R, 2 * n).real - R[0]


def lag_window(n):
    w = np.sin(np.pi * np.arange(n) / n) ** 2
    return np.correlate(w, w, "full")[n - 1 :] / np.sum(w**2)


def pole_of(spectrum, n, window):
    S = np.maximum(spectrum, 0)[:, None]
    (bell,) = find_bells(S, np.ones((len(S), 1, 1), complex), factor=4.0, min_mac=0.8)
    pole = bell_pole(bell, 2 * n, DT, window)
    return abs(pole) / (2 * np.pi), -pole.real / abs(pole)


def ambient(structure, n_samples, seed, *, noise=0.0, outputs=None, dt=DT):
    system = systems.instrumented(
        structure, systems.sensors(outputs or structure.dofs), systems.actuators(structure.dofs)
    )
    rng = np.random.default_rng(seed)
    forces = rng.standard_normal((len(structure.dofs), n_samples))
    record = systems.recorded(system.sampled(dt), [forces]).records[0]
    y = systems.noisy(record.outputs, noise, rng)
    return Recording((Record("ambient", np.zeros((0, n_samples)), y),), (), system.outputs, 1 / dt)


# --- One oscillator, in the mean


@pytest.mark.parametrize("damping", [0.005, 0.01, 0.02, 0.05])
@pytest.mark.parametrize("n", [1024, 4096])
def test_the_bias_of_the_damping_is_that_of_the_cut_tails(damping, n):
    f, zeta = pole_of(expected_spectrum(5.0, damping, n), n, lag_window(n))
    # No scatter here: what is left are the tails of the bell, which hold a per cent of its power or less,
    # and the static part of the response, which is no oscillation.
    assert zeta == pytest.approx(damping, rel=0.02)
    assert f == pytest.approx(5.0, rel=5e-4)


def test_without_the_correction_the_window_adds_damping():
    n, damping = 1024, 0.005
    biased = pole_of(expected_spectrum(5.0, damping, n), n, np.ones(n))[1]
    # The window of 20 s falls to half in 6 s, as a damping of 0.3 % would make it.
    assert biased > 1.3 * damping


def test_a_correlation_that_does_not_decay_is_fitted_as_far_as_it_goes():
    # A pure tone: the correlation is the window alone, and once that is divided out nothing decays.
    n = 1024
    R = np.cos(2 * np.pi * 5.0 * DT * np.arange(n)) * lag_window(n)
    spectrum = 2 * np.fft.rfft(R, 2 * n).real - R[0]
    _, zeta = pole_of(spectrum + 1e-6 * spectrum.max(), n, lag_window(n))
    assert abs(zeta) < 1e-4


# --- Peaks and bells


def test_peaks_rise_and_fall_by_the_factor():
    power = np.array([1, 2, 9, 8, 9.5, 2, 1, 3, 1, 5, 1.2])
    assert [peak.top for peak in find_peaks(power, 4.0)] == [4, 9]
    assert [peak.fall for peak in find_peaks(power, 4.0)] == [5, 10]
    assert [peak.top for peak in find_peaks(power[4:], 4.0, from_start=True)] == [0, 5]
    assert find_peaks(power, 10.0) == []


@given(st.lists(st.floats(0.01, 100), min_size=3, max_size=60), st.floats(1.5, 10))
def test_every_peak_stands_out_on_both_sides(values, factor):
    power = np.array(values)
    start = 0
    for peak in find_peaks(power, factor):
        assert power[peak.top] > factor * np.min(power[start : peak.top + 1])
        assert power[peak.top] > factor * power[peak.fall]
        start = peak.fall


def test_two_modes_that_cross_give_two_bells():
    # Two orthogonal shapes: the second singular value has a cusp where the spectra cross, which is no mode.
    lines = np.arange(400)
    one, two = (1 / (1 + ((lines - centre) / 6) ** 2) for centre in (150, 220))
    G = one[:, None, None] * np.diag([1.0, 0.0]) + two[:, None, None] * np.diag([0.0, 1.0])
    power, vectors = np.linalg.eigh(G + 1e-6 * np.eye(2))
    assert len(find_peaks(power[:, 0], 4.0)) == 1
    bells = find_bells(power[:, ::-1], vectors[:, :, ::-1].astype(complex), factor=4.0, min_mac=0.8)
    assert [bell.peak for bell in bells] == [150, 220]
    np.testing.assert_allclose(np.abs([bell.shape for bell in bells]), np.eye(2), atol=1e-12)
    # In its own shape each mode is seen alone, down to the floor.
    assert all(bell.prominence > 500 for bell in bells)


@pytest.mark.parametrize("seed", range(5))
def test_noise_shows_no_mode(seed):
    y = np.random.default_rng(seed).standard_normal((4, 20_000))
    channels = tuple(Channel(f"y{i}", "m/s^2") for i in range(4))
    recording = Recording((Record("ambient", np.zeros((0, 20_000)), y),), (), channels, 50.0)
    # By the rule once in a hundred records.
    assert len(fdd(recording).modes) == 0
    with pytest.raises(IdentificationError, match="no peak stands out"):
        efdd(recording)


# --- Structures


def test_modes_of_a_chain_with_noisy_sensors():
    structure = systems.chain7()
    found = fdd(ambient(structure, 100_000, 3, noise=0.3), n_segment=2048)
    truth = structure.modes().take(range(len(found.modes)))
    assert len(found.modes) >= 5  # the last two are one and a half bandwidths apart and hide
    # Au (2014): the damping of 2000 s is uncertain by (2 π ζ N)^-1/2 at best; this method scatters about twice as
    # much, and three of its standard deviations are allowed, and the 2 % of bias.
    variation = 1 / np.sqrt(2 * np.pi * truth.damping_ratio * 2000 * truth.frequency_hz)
    assert np.all(np.abs(found.modes.damping_ratio / truth.damping_ratio - 1) < 6 * variation + 0.02)
    np.testing.assert_allclose(found.modes.frequency_hz, truth.frequency_hz, rtol=3e-3)
    assert np.all(np.diag(mac(found.modes.shapes, truth.shapes)) > 0.999)
    # Plain FDD knows the frequency to a line or two.
    np.testing.assert_allclose(found.peak_hz, truth.frequency_hz, atol=12 * 50 / 4096)


def test_one_sensor_is_enough_for_frequencies():
    found = fdd(ambient(systems.chain7(), 100_000, 4, outputs=("x7",)), n_segment=2048).modes
    np.testing.assert_allclose(found.frequency_hz[:3], systems.chain7().modes().frequency_hz[:3], rtol=5e-3)


@settings(max_examples=5)
@given(st.floats(1e-3, 1e3))
def test_the_choice_of_a_unit_does_not_decide(unit):
    recording = ambient(systems.chain7(), 20_000, 5)
    outputs = (*recording.outputs[:4], *(replace(channel, unit="V") for channel in recording.outputs[4:]))
    scale = np.where(np.arange(7) < 4, 1.0, unit)[:, None]
    record = recording.records[0]
    mixed = replace(recording, outputs=outputs)
    scaled = replace(mixed, records=(replace(record, outputs=scale * record.outputs),))
    a, b = fdd(mixed).modes, fdd(scaled).modes
    np.testing.assert_allclose(b.frequency_hz, a.frequency_hz, rtol=1e-9)
    np.testing.assert_allclose(np.diag(mac(b.shapes, scale * a.shapes)), 1, atol=1e-9)


def test_models_hold_the_modes_that_stand_out_most():
    recording = ambient(systems.chain7(), 100_000, 6)
    found = fdd(recording, n_segment=2048)
    realization = efdd(recording, 4, orders=[2, 6], n_segment=2048)
    assert realization.orders == (2, 4, 6)
    for n in realization.orders:
        modes = realization.at(n).modes()
        strongest = np.argsort([-bell.prominence for bell in found.bells])[: n // 2]
        np.testing.assert_allclose(
            modes.frequency_hz, np.sort(found.modes.frequency_hz[strongest]), rtol=1e-10
        )
    everything = efdd(recording, n_segment=2048).system.modes()
    np.testing.assert_allclose(everything.damping_ratio, found.modes.damping_ratio, rtol=1e-8)
    np.testing.assert_allclose(np.diag(mac(everything.shapes, found.modes.shapes)), 1, atol=1e-10)
    with pytest.raises(OrderError, match=r"order 3 cannot be made of \d peaks"):
        efdd(recording, 3, n_segment=2048)
    with pytest.raises(OrderError, match="order 20 cannot be made"):
        efdd(recording, 20, n_segment=2048)


def test_bells_cannot_be_changed():
    bell = Bell(1, (0, 3), np.ones(3), np.ones(1, complex), 2.0)
    with pytest.raises(ValueError, match="read-only"):
        bell.power[0] = 2
