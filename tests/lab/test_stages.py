"""Every stage of the measurement chain against a formula or a loop of its own."""

import itertools
import math

import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.errors import RigError
from lab.stages import (
    STAGES,
    BandLimitedDelay,
    BandLimitedLag,
    Delay,
    Dropout,
    Gain,
    HeldLag,
    Hum,
    Lag,
    LowPass,
    Noise,
    Resolution,
    Saturation,
)

H = 0.01
EXAMPLES = {
    "gain": Gain("a", -0.1),
    "saturation": Saturation("a", 0.6),
    "lag": Lag("a", 3.0),
    "held_lag": HeldLag("a", 0.03),
    "band_limited_lag": BandLimitedLag("a", 5.0),
    "band_limited_delay": BandLimitedDelay("a", 0.013),
    "low_pass": LowPass("a", 4.0, 5),
    "delay": Delay("a", 0.0337),
    "hum": Hum("a", 7.0, 0.3, 0.4),
    "noise": Noise("a", percent=10.0, std=0.1, density=0.01),
    "resolution": Resolution("a", 0.05),
    "dropout": Dropout("a", 0.2),
}
BETWEEN = [name for name, stage in EXAMPLES.items() if not (stage.needs_samples or stage.at_samples)]


def rng(seed=0):
    return np.random.default_rng(seed)


def both_sides(n=200, seed=1):
    """A signal that is smooth between instants and jumps at each: just before, just after, and at the instant."""
    before, jump = np.cumsum(rng(seed).standard_normal((2, n)), axis=1)
    return np.stack([before, before + jump, before + jump])


def continuous(x):
    return np.stack([x, x, x])


def butterworth(corner_hz, order):
    """State space of the analog filter from its transfer function."""
    b, a = scipy.signal.butter(order, 2 * np.pi * corner_hz, analog=True)
    A, B, C, _ = scipy.signal.tf2ss(b, a)
    return A, B[:, 0], C[0]


def along_lines(A, B, C, start, end, h):
    """Output at each instant of ẋ = A x + B u where u runs in straight lines from `start` to `end` over each step."""
    n = len(A)
    F = np.zeros((n + 2, n + 2))  # x, u and its slope
    F[:n, :n], F[:n, n], F[n, n + 1] = A, B, 1.0
    step = scipy.linalg.expm(F * h)
    x, y = np.zeros(n), []
    for a, b in zip(start, end, strict=True):
        x = (step @ np.concatenate([x, [a, (b - a) / h]]))[:n]
        y.append(C @ x)
    return np.array(y)


def test_examples_cover_every_stage():
    assert set(EXAMPLES) == set(STAGES)


# What happens to a sampled signal.


def test_gain():
    x = rng().standard_normal(50)
    np.testing.assert_array_equal(Gain("a", -2.0).start(H, rng(), 0.0)(x), -x)
    np.testing.assert_allclose(Gain("a", 0.25).start(H, rng(), 0.0)(x), 1.25 * x, rtol=1e-15)


def test_saturation():
    x = np.array([-3.0, -0.5, 0.0, 0.5, 3.0])
    np.testing.assert_array_equal(Saturation("a", 1.0).start(H, rng(), 0.0)(x), [-1, -0.5, 0, 0.5, 1])


def test_held_lag_is_a_sampled_first_order_lag():
    x, tau, y = rng().standard_normal(60), 0.03, 0.0
    lagging = HeldLag("a", tau).start(H, rng(), 0.0)(x)
    for value, given_ in zip(lagging, x, strict=True):
        y = math.exp(-H / tau) * y + (1 - math.exp(-H / tau)) * given_
        assert value == pytest.approx(y, rel=1e-12, abs=1e-15)


def test_band_limited_lag_divides_every_tone():
    n, f, corner = 4000, 7.0, 5.0
    t = np.arange(n) * H
    window = np.hanning(n)
    y = BandLimitedLag("a", corner).start(H, rng(), 0.0)(window * np.sin(2 * np.pi * f * t))
    turned = np.exp(2j * np.pi * f * t) / (1 + 1j * f / corner)
    # The window is slow against the lag: its slope, 1 / 20 s, times the lag's 0.03 s is what the comparison leaves out.
    assert np.max(np.abs(y - window * turned.imag)) < 0.03 / 20 * np.pi


def test_resolution_rounds_to_the_nearest_step():
    x = np.linspace(-1, 1, 333)
    y = Resolution("a", 0.1).start(H, rng(), 0.0)(x)
    np.testing.assert_allclose(y, [0.1 * round(v * 10) for v in x], atol=1e-15)
    assert np.max(np.abs(y - x)) <= 0.05 + 1e-15


def test_hum():
    x, k = rng().standard_normal(100), np.arange(100)
    y = Hum("a", 50.0, 0.2, 0.7).start(1e-3, rng(), 0.0)(x)
    np.testing.assert_allclose(
        y - x, [0.2 * math.sin(2 * math.pi * 50 * i / 1000 + 0.7) for i in k], atol=1e-15
    )


@pytest.mark.parametrize(
    ("stage", "sigma"),
    [
        (Noise("a", percent=5.0), 0.05 * 3.0),
        (Noise("a", std=0.7), 0.7),
        # One-sided density up to half the sample rate: variance is density² fs / 2.
        (Noise("a", density=0.02), 0.02 * math.sqrt(100.0 / 2)),
        (Noise("a", percent=5.0, std=0.7, density=0.02), math.sqrt(0.15**2 + 0.7**2 + 0.02**2 * 50)),
    ],
)
def test_noise_has_the_size_it_promises(stage, sigma):
    n = 40_000
    noise = stage.start(H, rng(3), 3.0)(np.zeros(n))
    assert stage.noise(H, 3.0) == pytest.approx(sigma, rel=1e-14)
    # The standard deviation of n samples scatters by 1 / √(2 n) = 0.35 %; four of that.
    assert np.std(noise) == pytest.approx(sigma, rel=4 / math.sqrt(2 * n))
    assert abs(np.mean(noise)) < 4 * sigma / math.sqrt(n)
    # White: the correlation of neighbours scatters by 1 / √n.
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 4 / math.sqrt(n)


def test_density_of_noise_in_the_spectrum():
    """Welch's estimate of the one-sided density is the density asked for, whatever the sample rate."""
    for fs in (100.0, 2000.0):
        noise = Noise("a", density=0.02).start(1 / fs, rng(4), 0.0)(np.zeros(100_000))
        _, power = scipy.signal.welch(noise, fs, nperseg=256)
        # The mean over all frequencies of the density has the scatter of the variance: √(2 / n) = 0.45 %.
        assert np.sqrt(np.mean(power[1:-1])) == pytest.approx(0.02, rel=0.01)


def test_dropouts_are_missing_samples():
    x = rng().standard_normal(20_000)
    y = Dropout("a", 0.1).start(H, rng(5), 0.0)(x)
    lost = np.isnan(y)
    np.testing.assert_array_equal(y[~lost], x[~lost])
    # Binomial: four standard deviations.
    assert np.mean(lost) == pytest.approx(0.1, abs=4 * math.sqrt(0.1 * 0.9 / x.size))


def test_stages_that_add_no_noise_say_so():
    for name, stage in EXAMPLES.items():
        expected = {"noise": stage.noise(H, 1.0), "resolution": 0.05 / math.sqrt(12)}.get(name, 0.0)
        assert stage.noise(H, 1.0) == pytest.approx(expected)
    # Rounding errors are spread evenly over a step.
    x = rng().uniform(-1, 1, 50_000)
    errors = EXAMPLES["resolution"].start(H, rng(), 0.0)(x) - x
    assert np.std(errors) == pytest.approx(EXAMPLES["resolution"].noise(H, 0.0), rel=0.01)


# What happens to a sensor's signal between samples.


@pytest.mark.parametrize(
    ("stage", "order"), [(Lag("a", 3.0), 1), *((LowPass("a", 3.0, n), n) for n in (2, 3, 8))]
)
def test_low_passes_equal_lsim_on_smooth_signals(stage, order):
    t = np.arange(300) * H
    x = np.sin(3 * t) + 0.3 * np.sin(40 * t)
    y = stage.start(H, rng(), 0.0)(continuous(x))
    b, a = scipy.signal.butter(order, 2 * np.pi * 3.0, analog=True)
    # lsim too runs in straight lines between samples; both round a sum of up to eight modes.
    _, expected, _ = scipy.signal.lsim((b, a), x, t)
    for row in y:
        np.testing.assert_allclose(row, expected, atol=1e-10)


@pytest.mark.parametrize(
    ("stage", "order"), [(Lag("a", 3.0), 1), (LowPass("a", 3.0, 4), 4), (LowPass("a", 30.0, 7), 7)]
)
def test_low_passes_where_the_signal_jumps(stage, order):
    x = both_sides()
    y = stage.start(H, rng(), 0.0)(x)
    A, B, C = butterworth(stage.corner_hz, order)
    # The filter had settled on the first value; lines run from just after an instant to just before the next.
    expected = along_lines(A, B, C, x[1, :-1] - x[0, 0], x[0, 1:] - x[0, 0], H)
    np.testing.assert_allclose(y[2, 1:], expected + x[0, 0], atol=1e-9 * np.max(np.abs(x)))
    assert y[2, 0] == pytest.approx(x[0, 0])


def test_lag_of_a_step_is_an_exponential():
    x = np.ones((3, 100))
    x[0, 0] = 0.0
    y = Lag("a", 1 / (2 * np.pi * 0.2)).start(H, rng(), 0.0)(x)[2]
    np.testing.assert_allclose(y, 1 - np.exp(-np.arange(100) * H / 0.2), atol=1e-14)


def test_low_pass_is_three_decibels_down_at_its_corner():
    for stage in (Lag("a", 5.0), LowPass("a", 5.0, 6)):
        t = np.arange(40_000) * 1e-3
        y = stage.start(1e-3, rng(), 0.0)(continuous(np.sin(2 * np.pi * 5 * t)))[2, 20_000:]
        # Straight lines between samples shorten a sine by (ω h)² / 12 = 8e-5.
        assert np.sqrt(2) * np.std(y) == pytest.approx(1 / np.sqrt(2), rel=2e-4)


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.0337, 0.004, 1.234, 5.0])
def test_delay_of_a_smooth_signal_is_interpolation(delay):
    t = np.arange(300) * H
    x = np.sin(3 * t) + 0.3
    y = Delay("a", delay).start(H, rng(), 0.0)(continuous(x))
    # Before the record the signal stood at its first value, as np.interp has it.
    expected = np.interp(t - delay, t, x)
    for row in y:
        np.testing.assert_allclose(row, expected, atol=1e-14)


def test_delay_of_a_signal_that_jumps():
    x, delay = both_sides(), 0.0337
    y = Delay("a", delay).start(H, rng(), 0.0)(x)
    for k in range(x.shape[1]):
        s = k - delay / H
        i = math.floor(s)
        expected = x[0, 0] if i < 0 else (1 - (s - i)) * x[1, i] + (s - i) * x[0, i + 1]
        np.testing.assert_allclose(y[:, k], expected, atol=1e-12)


def test_delay_by_whole_steps_keeps_both_sides_of_a_jump():
    x = both_sides()
    y = Delay("a", 3 * H).start(H, rng(), 0.0)(x)
    np.testing.assert_array_equal(y[:, 3:], x[:, :-3])
    np.testing.assert_array_equal(y[:, :3], x[0, 0])


# What happens to a force that is held over each substep.


def held(u):
    return np.stack([u, u, u])


@pytest.mark.parametrize(
    ("stage", "order"), [(Lag("a", 3.0), 1), (LowPass("a", 9.0, 3), 3), (LowPass("a", 3.0, 8), 8)]
)
def test_held_force_through_a_low_pass(stage, order):
    u = rng(2).standard_normal(200)
    start, mean, end = stage.start_held(H)(held(u))
    A, B, C = butterworth(stage.corner_hz, order)
    n = order
    F = np.zeros((n + 2, n + 2))  # x, the integral of y, and the held u
    F[:n, :n], F[n, :n], F[:n, n + 1] = A, C, B
    step, x = scipy.linalg.expm(F * H), np.zeros(n)
    for k in range(u.size):
        after = step @ np.concatenate([x, [0.0, u[k]]])
        np.testing.assert_allclose(
            [start[k], mean[k], end[k]], [C @ x, after[n] / H, C @ after[:n]], atol=1e-9
        )
        x = after[:n]


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.0337, 0.004])
def test_held_force_delayed_keeps_its_momentum(delay):
    u = rng(2).standard_normal(200)
    start, mean, end = Delay("a", delay).start_held(H)(held(u))

    def integral(t):
        """∫ of the delayed force: a line between the momenta at whole steps."""
        edges = np.arange(u.size + 1) * H
        return np.interp(t - delay, edges, np.concatenate([[0.0], np.cumsum(u) * H]))

    t = np.arange(u.size) * H
    np.testing.assert_allclose(mean, (integral(t + H) - integral(t)) / H, atol=1e-12)
    # Just inside both ends of each substep.
    tiny = 1e-6 * H
    np.testing.assert_allclose(start, (integral(t + tiny) - integral(t)) / tiny, atol=1e-6)
    np.testing.assert_allclose(end, (integral(t + H) - integral(t + H - tiny)) / tiny, atol=1e-6)


def test_held_hum():
    start, mean, end = Hum("a", 7.0, 0.3, 0.4).start_held(H)(np.ones((3, 50)))
    t, omega = np.arange(50) * H, 2 * np.pi * 7.0
    np.testing.assert_allclose(start, 1 + 0.3 * np.sin(omega * t + 0.4), atol=1e-14)
    np.testing.assert_allclose(end, 1 + 0.3 * np.sin(omega * (t + H) + 0.4), atol=1e-14)
    primitive = -0.3 * np.cos(omega * np.arange(51) * H + 0.4) / omega
    np.testing.assert_allclose(mean, 1 + np.diff(primitive) / H, atol=1e-13)


# Blocks.


@settings(max_examples=20)
@given(st.lists(st.integers(0, 200), max_size=6))
@pytest.mark.parametrize("name", [name for name in STAGES if not EXAMPLES[name].whole_record])
def test_a_signal_cut_into_blocks_gives_the_same_bits(name, cuts):
    stage, x = EXAMPLES[name], both_sides()
    starts = [lambda: stage.start(H, rng(9), 1.5)]
    if name in BETWEEN:
        starts.append(lambda: stage.start_held(H))
    else:
        x = x[0]
    edges = [0, *sorted(cuts), x.shape[-1]]
    for start in starts:
        process, whole = start(), start()(x)
        parts = [process(x[..., a:b]) for a, b in itertools.pairwise(edges) if b > a]
        np.testing.assert_array_equal(np.concatenate(parts, axis=-1), whole)


@pytest.mark.parametrize(
    ("stage", "setting", "value"),
    [
        (Saturation, "limit", 0.0),
        (Lag, "corner_hz", 0.0),
        (Lag, "corner_hz", math.nan),
        (LowPass, "corner_hz", -1.0),
        (Delay, "delay", -0.1),
        (Noise, "percent", -5.0),
        (Noise, "std", math.inf),
        (Resolution, "step", 0.0),
        (Dropout, "probability", -0.5),
        (Gain, "relative_change", None),
    ],
)
def test_impossible_settings_are_refused(stage, setting, value):
    with pytest.raises(RigError, match=f"{setting} of stage '{stage.name}' on 'a' is .*; expected a"):
        stage("a", **{setting: value})
