"""Every excitation drives as it promises: spectrum, size, duration, momentum."""

import math

import numpy as np
import pytest
import scipy.signal

from lab.errors import LabError, UnknownNameError
from lab.excitation import (
    EXCITATIONS,
    Ambient,
    BurstRandom,
    FreeDecay,
    Impact,
    Multisine,
    Pulse,
    Random,
    Sweep,
)
from lab.loads import BLOCK, BandNoise, Sampling
from lab.rig import Rig
from tests.lab.structures import model, oscillator

RIG = model("chain3_uncoupled")
SAMPLING = Sampling(100.0, 10_000)

EXAMPLES = {
    "pulse": Pulse(2.0),
    "impact": Impact(100.0, 0.0123, 0.05),
    "random": Random(3.0, (10.0, 20.0)),
    "burst_random": BurstRandom(3.0, None, 0.3),
    "sweep": Sweep(2.0, (1.0, 30.0)),
    "multisine": Multisine(2.0, (5.0, 20.0), 4.0),
    "ambient": Ambient(2.0, (0.0, 30.0), ("x1", "x3")),
    "free_decay": FreeDecay({"x1": 0.1}, {"x3": -0.2}),
}


def loads(drive, *, sampling=SAMPLING, seed=0, rig=RIG):
    return drive.loads(rig, sampling, np.random.default_rng(seed))


def signals(load):
    """Commanded inputs and unmeasured forces of a whole record."""
    inputs, forces = zip(*load.blocks(), strict=True)
    whole = np.concatenate(inputs, axis=1)
    return whole, None if forces[0] is None else np.concatenate(forces, axis=1)


def test_examples_cover_every_excitation():
    assert {name: type(drive) for name, drive in EXAMPLES.items()} == EXCITATIONS


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_records_last_as_long_as_asked_and_repeat(kind):
    for load in loads(EXAMPLES[kind]):
        assert load.kind == kind
        assert load.n_samples == SAMPLING.n_samples
        inputs, forces = signals(load)
        assert inputs.shape == (3, SAMPLING.n_samples)
        again, forces_again = signals(load)
        np.testing.assert_array_equal(inputs, again)
        assert forces is None or np.array_equal(forces, forces_again)
        assert load.position.shape == load.velocity.shape == (3,)


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_a_seed_fixes_everything(kind):
    drive = EXAMPLES[kind]
    chance = kind in ("random", "burst_random", "multisine", "ambient")
    for a, b, c in zip(loads(drive, seed=1), loads(drive, seed=1), loads(drive, seed=2), strict=True):
        first, same, other = (np.vstack([x for x in signals(load) if x is not None]) for load in (a, b, c))
        np.testing.assert_array_equal(first, same)
        assert np.array_equal(first, other) != chance


@pytest.mark.parametrize("kind", EXCITATIONS)
@pytest.mark.parametrize("block", [1, 777, 20_000])
def test_size_of_blocks_does_not_matter(kind, block, monkeypatch):
    sampling = Sampling(100.0, 2000 if block == 1 else 10_000)
    whole = [signals(load) for load in loads(EXAMPLES[kind], sampling=sampling)]
    for module in ("excitation", "loads"):
        monkeypatch.setattr(f"lab.{module}.BLOCK", block)
    assert block != BLOCK
    for load, (inputs, forces) in zip(loads(EXAMPLES[kind], sampling=sampling), whole, strict=True):
        again, forces_again = signals(load)
        np.testing.assert_array_equal(again, inputs)
        assert forces is None or np.array_equal(forces_again, forces)


@pytest.mark.parametrize("kind", ["pulse", "impact", "sweep"])
def test_one_input_after_the_other(kind):
    for row, load in enumerate(loads(EXAMPLES[kind])):
        inputs, forces = signals(load)
        assert forces is None
        assert inputs[row].any()
        assert not np.delete(inputs, row, axis=0).any()
    assert row == 2


def test_pulse_is_held_for_one_sample():
    inputs, _ = signals(loads(Pulse(2.5))[0])
    assert inputs[0, 0] == 2.5
    assert not inputs[0, 1:].any()


@pytest.mark.parametrize("width", [0.3, 0.0123, 1e-4])
@pytest.mark.parametrize("start", [0.0, 0.0555])
def test_impact_has_the_momentum_of_a_half_sine(width, start):
    inputs, _ = signals(loads(Impact(100.0, width, start))[0])
    momentum = np.sum(inputs[0]) / 100.0
    # ∫ A sin(π t / w) dt = 2 A w / π, exactly, however few samples it lasts.
    assert momentum == pytest.approx(2 * 100.0 * width / math.pi, rel=1e-12)
    assert np.all(inputs >= 0)
    k = np.arange(SAMPLING.n_samples)
    silent = ((k + 1) / 100.0 <= start) | (k / 100.0 >= start + width)
    assert not inputs[0, silent].any()


def test_long_impact_is_a_half_sine():
    inputs, _ = signals(loads(Impact(100.0, 1.0, 0.25))[0])
    middle = (np.arange(SAMPLING.n_samples) + 0.5) / 100.0 - 0.25
    expected = np.where((middle > 0) & (middle < 1), 100 * np.sin(np.pi * middle), 0)
    # The mean over a sample is the value at its middle less (π / 100)² / 24.
    np.testing.assert_allclose(inputs[0], expected, atol=100 * np.pi**2 / 1e4 / 24 * 1.01)


def frequency_of(signal, fs):
    """Instantaneous frequency [Hz] from the analytic signal."""
    return np.diff(np.unwrap(np.angle(scipy.signal.hilbert(signal)))) * fs / (2 * np.pi)


@pytest.mark.parametrize("law", ["linear", "logarithmic"])
def test_sweep_runs_through_its_band(law):
    inputs, _ = signals(loads(Sweep(2.0, (2.0, 20.0), law))[0])
    x, t = inputs[0], SAMPLING.time
    share = t / 100.0
    expected = 2 + 18 * share if law == "linear" else 2 * 10**share
    inner = slice(500, -500)
    # The analytic signal of a sweep is blurred by its ends: a percent in the middle of the record.
    np.testing.assert_allclose(frequency_of(x, 100.0)[inner], expected[:-1][inner], rtol=0.03)
    assert x[0] == pytest.approx(0.0, abs=1e-12)
    assert x[1] > 0
    assert np.max(np.abs(x)) == pytest.approx(2.0, rel=1e-2)
    assert np.sqrt(np.mean(x**2)) == pytest.approx(2 / np.sqrt(2), rel=0.01)


def test_sweep_without_a_band_reaches_half_the_sample_rate():
    inputs, _ = signals(loads(Sweep())[0])
    k = np.arange(SAMPLING.n_samples)
    # Phase 2 π f² t² / (2 f T) with f = fs / 2: k² π / (2 n).
    np.testing.assert_allclose(inputs[0], np.sin(np.pi * k**2 / (2 * k.size)), atol=1e-8)


@pytest.mark.parametrize("kind", [Random, Ambient])
def test_white_noise_has_its_size_on_every_row(kind):
    inputs, forces = signals(loads(kind(rms=3.0), sampling=Sampling(100.0, 40_000))[0])
    x = inputs if forces is None else forces
    assert x.shape[0] == 3
    # Four times the scatter of the standard deviation of n samples.
    np.testing.assert_allclose(np.std(x, axis=1), 3.0, rtol=4 / math.sqrt(2 * 40_000))
    correlation = np.corrcoef(x)
    assert np.max(np.abs(correlation - np.eye(3))) < 4 / math.sqrt(40_000)


@pytest.mark.parametrize("band", [(10.0, 20.0), (0.0, 5.0), (30.0, 50.0), (12.0, 12.5)])
@pytest.mark.parametrize("kind", [Random, BurstRandom, Ambient])
def test_band_limited_noise_keeps_to_its_band(kind, band):
    drive = kind(rms=3.0, band=band, **({"burst": 1.0} if kind is BurstRandom else {}))
    n = 200_000
    inputs, forces = signals(loads(drive, sampling=Sampling(100.0, n))[0])
    x = (inputs if forces is None else forces)[:, 2000:]
    # Noise of bandwidth B has 2 B T independent values in T seconds.
    independent = 2 * (band[1] - band[0]) * n / 100.0
    np.testing.assert_allclose(np.std(x, axis=1), 3.0, rtol=5 / math.sqrt(2 * independent))
    f, power = scipy.signal.welch(x, 100.0, nperseg=4096)
    inside = (f >= band[0]) & (f <= band[1])
    outside = (f < band[0] / 2) | (f > min(band[1] * 2, 60))
    # An edge of order six falls by 64 in amplitude per octave; welch's window leaks less than that.
    assert np.sum(power[:, outside]) < 1e-3 * np.sum(power)
    # Half of the power at an edge is missing: the band holds most of it.
    assert np.sum(power[:, inside]) > 0.85 * np.sum(power)


@pytest.mark.parametrize(
    ("band", "fs"), [((10.0, 20.0), 100.0), ((0.0, 1.0), 1000.0), ((5.0, 5.1), 4000.0), ((40.0, 50.0), 100.0)]
)
def test_band_limited_noise_is_scaled_by_the_energy_of_its_filter(band, fs):
    """Twin: the impulse response, summed until it has died down."""
    noise = BandNoise(1, 1.0, band, Sampling(fs, 10), 0)
    sections, scale = noise._filter()
    n = int(60 * fs / (band[1] - band[0]))
    impulse = np.zeros(n)
    impulse[0] = 1.0
    response = scipy.signal.sosfilt(sections, impulse)
    # Rounding in the filter of the narrowest band is the limit of the twin.
    assert scale**2 * np.sum(response**2) == pytest.approx(1.0, rel=1e-6)


def test_whole_band_is_white():
    whole = signals(loads(Random(band=(0.0, 50.0)))[0])[0]
    np.testing.assert_array_equal(whole, signals(loads(Random())[0])[0])


def test_shorter_record_is_the_start_of_a_longer_one():
    for kind in ("random", "ambient"):
        long = signals(loads(EXAMPLES[kind])[0])
        short = signals(loads(EXAMPLES[kind], sampling=Sampling(100.0, 5000))[0])
        for a, b in zip(long, short, strict=True):
            assert a is None or np.array_equal(a[:, :5000], b)


def test_burst_falls_silent():
    burst = signals(loads(BurstRandom(3.0, None, 0.3))[0])[0]
    np.testing.assert_array_equal(burst[:, :3000], signals(loads(Random(3.0))[0])[0][:, :3000])
    assert not burst[:, 3000:].any()


def test_multisine_is_periodic_with_flat_lines_of_random_phase():
    drive = Multisine(rms=2.0, band=(5.0, 20.0), period=4.0)
    x, _ = signals(loads(drive)[0])
    period = 400
    np.testing.assert_array_equal(x[:, period:], x[:, :-period])
    one = np.fft.rfft(x[:, :period], axis=1) / period
    f = np.arange(period // 2 + 1) / 4.0
    used = (f >= 5) & (f <= 20)
    # All power in the band: n lines of equal amplitude a, rms² = n a² / 2.
    amplitude = 2.0 * math.sqrt(2 / used.sum())
    np.testing.assert_allclose(2 * np.abs(one[:, used]), amplitude, rtol=1e-12)
    assert np.max(np.abs(one[:, ~used])) < 1e-14
    np.testing.assert_allclose(np.sqrt(np.mean(x[:, :period] ** 2, axis=1)), 2.0, rtol=1e-13)
    phases = np.angle(one[:, used]).ravel()
    # Phases over the whole circle: the mean of n unit vectors is about 1 / √n.
    assert abs(np.mean(np.exp(1j * phases))) < 3 / math.sqrt(phases.size)


def test_multisine_without_a_period_fills_the_record():
    x, _ = signals(loads(Multisine(), sampling=Sampling(100.0, 501))[0])
    lines = np.abs(np.fft.rfft(x, axis=1))
    np.testing.assert_allclose(lines[:, 1:], lines[:, 1:2].repeat(250, axis=1), rtol=1e-10)
    np.testing.assert_allclose(lines[:, 0], 0, atol=1e-10)


def test_multisine_keeps_the_lines_on_the_edges_of_its_band():
    # 0.3 is no multiple of 0.1 in floating point, and the line is meant all the same.
    sampling = Sampling(10.0, 100)
    x, _ = signals(loads(Multisine(band=(0.3, 0.7)), sampling=sampling)[0])
    present = np.flatnonzero(np.abs(np.fft.rfft(x[0])) > 1e-9)
    np.testing.assert_array_equal(present, [3, 4, 5, 6, 7])


def test_ambient_forces_are_not_recorded():
    (load,) = loads(EXAMPLES["ambient"])
    inputs, forces = signals(load)
    assert not load.measured
    assert not inputs.any()
    np.testing.assert_array_equal(np.any(forces != 0, axis=1), [True, False, True])


def test_free_decay_starts_where_told():
    (load,) = loads(EXAMPLES["free_decay"])
    inputs, forces = signals(load)
    assert not load.measured
    assert not inputs.any()
    assert forces is None
    np.testing.assert_array_equal(load.position, [0.1, 0, 0])
    np.testing.assert_array_equal(load.velocity, [0, 0, -0.2])


def test_only_connected_inputs_are_driven():
    rig = RIG.connected(inputs=["force3", "force1"])
    assert [signals(load)[0].shape[0] for load in loads(Pulse(), rig=rig)] == [2, 2]
    assert signals(loads(Random(), rig=rig)[0])[0].shape[0] == 2


@pytest.mark.parametrize(
    ("drive", "message"),
    [
        (Pulse(math.nan), "amplitude of a test of kind 'pulse' is nan"),
        (Impact(width=0.0), "width of a test of kind 'impact' is 0.0; expected a finite number above zero"),
        (Impact(start=-1.0), "start of a test of kind 'impact' is -1.0"),
        (Impact(start=99.995), "blow ends at 100.005 s, after the record of 100.0 s"),
        (Random(rms=-1.0), "rms of a test of kind 'random' is -1.0"),
        (Random(rms=math.inf), "rms of a test of kind 'random' is inf"),
        (Random(band=(20.0, 10.0)), r"band is 20.0 to 10.0 Hz; expected 0 <= low < high <= 50.0 Hz"),
        (Random(band=(10.0, 51.0)), "half the sample rate"),
        (BurstRandom(burst=1.5), "burst is 1.5; expected a share"),
        (BurstRandom(burst=-0.5), "burst of a test of kind 'burst_random' is -0.5"),
        (Sweep(band=(0.0, 10.0), law="logarithmic"), "cannot start at 0.0 Hz"),
        (Sweep(law="cubic"), "sweep law is 'cubic'; expected 'linear' or 'logarithmic'"),
        (Multisine(period=0.125), "12.5 samples; expected a whole number of samples, as 0.12 s is"),
        (Multisine(period=-1.0), "period of a test of kind 'multisine' is -1.0"),
        (Multisine(band=(5.1, 5.2), period=2.0), "no line between 5.1 and 5.2 Hz"),
        (Ambient(dofs=()), "at least one degree of freedom"),
        (Ambient(dofs=("x1", "x1")), "each once"),
        (FreeDecay(), "starts at rest"),
        (FreeDecay({"x1": math.nan}), "release of 'x1' is nan"),
    ],
)
def test_settings_that_make_no_sense(drive, message):
    with pytest.raises(LabError, match=message) as caught:
        loads(drive)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "drive", [Ambient(dofs=("y",)), FreeDecay({"y": 1.0}), FreeDecay(velocity={"y": 1.0})]
)
def test_unknown_degrees_of_freedom_list_those_that_exist(drive):
    with pytest.raises(UnknownNameError, match="'y' does not exist; there are x1, x2, x3"):
        loads(drive)


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_without_an_actuator(kind):
    rig = Rig.from_xml(oscillator().replace('<motor name="force" joint="x"/>', ""))
    drive = {"ambient": Ambient(), "free_decay": FreeDecay({"x": 1.0})}.get(kind, EXAMPLES[kind])
    if kind in ("ambient", "free_decay"):
        assert signals(loads(drive, rig=rig)[0])[0].shape == (0, SAMPLING.n_samples)
        return
    with pytest.raises(LabError, match=f"kind '{kind}' needs an actuator"):
        loads(drive, rig=rig)
