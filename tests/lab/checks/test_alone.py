"""Each check on recordings from a seed: it finds what was put in, and stays silent on clean ones of every kind.

The thresholds stand for less than one false remark in 1000 clean channels, so that none may come in the few dozen here.
"""

import numpy as np
import pytest

import lab
from identification.recording import Channel, Record, Recording
from lab.checks import CHECKS
from tests.lab.checks.benches import KINDS, N_SAMPLES, RATE, SPOIL, clean, rms, spoilt

DRIVES_THE_MAINS = ("sweep", "multisine")


def names(remarks, channel=None):
    return {remark.check for remark in remarks if channel in (None, remark.channel)}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("noise", [0.01, 0.0])
def test_nothing_is_said_of_clean_recordings(kind, noise):
    for seed in range(2):
        assert lab.check(clean(kind, seed, noise=noise)) == []


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("check", SPOIL)
def test_what_was_put_in_is_found_on_its_channel_alone(kind, check):
    if check == "hum" and kind in DRIVES_THE_MAINS:
        pytest.skip("the input itself drives the line")
    # The first decay outlasts the limit only where the excitation goes on.
    if check == "clipping" and kind in ("pulse", "impact", "free_decay"):
        pytest.skip("a decay may reach the limit too seldom to be told")
    recording = clean(kind, 1)
    remarks = lab.check(spoilt(recording, 2, SPOIL[check](np.random.default_rng(0))))
    assert check in names(remarks, recording.outputs[2].name)
    assert {remark.channel for remark in remarks} == {recording.outputs[2].name}


def single(y, unit="m/s^2", kind="ambient", rate=RATE):
    return Recording((Record(kind, np.zeros((0, y.size)), y[None]),), (), (Channel("a", unit),), rate)


def test_the_time_and_size_of_a_spike_are_told():
    x = np.random.default_rng(3).standard_normal(4000).cumsum()  # any colour
    x[1234] += 30.0
    x -= x.mean()
    (remark,) = [r for r in lab.check(single(x)) if r.check == "spikes"]
    assert (remark.start, remark.stop) == (1234 / RATE, 1235 / RATE)
    # The neighbours foretell the sample to about 1 / √2 of an increment, which is 1.
    assert remark.evidence["largest"] == pytest.approx(30.0, abs=4.0)


def test_the_size_of_a_jump_is_told():
    x = np.random.default_rng(4).standard_normal(4000)
    x[2000:] += 10.0
    (remark,) = lab.check(single(x))
    # 64 samples tell the level to 1/8 of their scatter, and white noise costs the lagged terms little.
    assert remark.check == "jumps"
    assert remark.start == pytest.approx(2000 / RATE, abs=1.5 / RATE)
    assert remark.evidence["largest"] == pytest.approx(10.0, abs=1.0)


def test_an_encoder_set_back_for_a_second_is_two_jumps():
    t = np.arange(N_SAMPLES) / RATE
    counts = np.round(500 * np.sin(2 * np.pi * t) * np.exp(-0.3 * t))
    counts[6000:6200] += 1320
    (remark,) = [r for r in lab.check(single(counts / 56000, "m", "free_decay")) if r.check == "jumps"]
    assert remark.evidence["jumps"] == 2
    assert abs(remark.evidence["largest"]) == pytest.approx(1320 / 56000, rel=0.01)


def test_a_square_wave_is_neither_clipped_nor_rounded_nor_interrupted():
    t = np.arange(N_SAMPLES) / RATE
    square = np.sign(np.sin(2 * np.pi * 0.7 * t + 0.1))
    pulses = np.where(np.sin(2 * np.pi * 0.3 * t) > 0.5, square, 0.0)
    recording = clean("random", 0)
    for u in (square, pulses):
        record = Record("other", u[None], recording.records[0].outputs)
        made = Recording((record,), recording.inputs, recording.outputs, RATE)
        assert names(lab.check(made), "force4") <= {"excitation"}


def test_the_round_top_of_a_slow_rounded_sine_is_no_limit():
    t = np.arange(N_SAMPLES) / RATE
    for levels in (10.3, 20.9, 50.5):
        sine = np.round(levels * np.sin(2 * np.pi * 0.5137 * t))
        assert "clipping" not in names(lab.check(single(sine / 1000)))


def test_counts_and_gravity_are_noticed():
    rng = np.random.default_rng(5)
    counts = np.round(300 * rng.standard_normal(4000))
    assert "units" in names(lab.check(single(counts, "m")))
    assert "units" in names(lab.check(single(1.0 + 0.01 * rng.standard_normal(4000))))
    assert "units" not in names(lab.check(single(9.81 + 0.01 * rng.standard_normal(4000))))


def test_two_readings_of_one_place_must_agree():
    rng = np.random.default_rng(6)
    t = np.arange(N_SAMPLES) / RATE
    f, phase = rng.uniform(1, 20, 40), rng.uniform(0, 6, 40)
    waves = np.sin(2 * np.pi * f[:, None] * t + phase[:, None])
    x, a = waves.sum(axis=0), -((2 * np.pi * f) ** 2) @ waves
    channels = (Channel("x", "m", "q"), Channel("a", "m/s^2", "q"))
    for factor, expected in ((1.0, set()), (9.80665, {"units"}), (1e-3, {"units"})):
        record = Record("ambient", np.zeros((0, t.size)), np.stack([x / 1e3, a / 1e3 * factor]))
        remarks = [r for r in lab.check(Recording((record,), (), channels, RATE)) if r.check == "units"]
        assert {r.check for r in remarks} == expected
        # The window of a piece spreads each line over its neighbours, where ω⁴ differs.
        assert all(r.evidence["factor"] == pytest.approx(factor, rel=0.15) for r in remarks)


def test_repeated_samples_tell_the_true_rate():
    x = np.repeat(np.random.default_rng(7).standard_normal(3000), 4)
    (remark,) = [r for r in lab.check(single(x)) if r.check == "rate"]
    assert remark.evidence["repeats"] == 4


def test_one_cable_on_two_channels_is_noticed():
    recording = clean("ambient", 2)
    record = recording.records[0]
    y = np.array(record.outputs)
    y[3] = -y[1]
    made = Recording((Record("ambient", record.inputs, y),), (), recording.outputs, RATE)
    (remark,) = lab.check(made)
    assert (remark.check, remark.channel) == (
        "twins",
        f"{recording.outputs[1].name}|{recording.outputs[3].name}",
    )


def test_an_input_that_drives_only_low_resonances_is_noticed():
    rng = np.random.default_rng(8)
    u = np.convolve(
        rng.standard_normal(N_SAMPLES + 400), np.sinc(0.1 * np.arange(-200, 201)) * np.hanning(401), "valid"
    )
    poles = np.exp((-0.01 + 1j) * np.array([0.05, 1.5]))
    y = sum(
        np.real(_filtered(p, force))
        for p, force in zip(poles, (u, 100.0 * rng.standard_normal(u.size)), strict=True)
    )
    made = Recording(
        (Record("random", u[None], y[None]),), (Channel("f", "N"),), (Channel("a", "m/s^2"),), RATE
    )
    (remark,) = [r for r in lab.check(made) if r.check == "excitation"]
    # 1.5 rad per sample, to the width of a line.
    assert remark.evidence["lowest_hz"] == pytest.approx(1.5 * RATE / (2 * np.pi), abs=0.5)


def _filtered(pole, x):
    import scipy.signal

    return scipy.signal.lfilter([1.0], [1.0, -pole], x.astype(complex))


def test_an_output_that_the_input_does_not_drive_has_low_coherence():
    recording = clean("random", 1)
    other = clean("random", 5)
    y = np.array(recording.records[0].outputs)
    y[1] = np.array(other.records[0].outputs)[1] / rms(np.array(other.records[0].outputs)[1]) * rms(y[1])
    record = Record("random", recording.records[0].inputs, y)
    remarks = lab.check(Recording((record,), recording.inputs, recording.outputs, RATE))
    assert [(r.check, r.channel) for r in remarks] == [("coherence", recording.outputs[1].name)]
    # Nothing is shared: what is left is the scatter of 31 averages.
    assert remarks[0].evidence["coherence"] < 0.2


def test_blocks_do_not_matter(monkeypatch):
    import lab.checks.survey as survey

    recording = clean("ambient", 3)
    for check in ("spikes", "jumps", "drift", "clipping", "dropouts", "hum", "missing"):
        made = spoilt(recording, 0, SPOIL[check](np.random.default_rng(1)))
        whole = {(r.check, r.channel) for r in lab.check(made)}
        monkeypatch.setattr(survey, "BLOCK_VALUES", 4 * 2048)
        assert {(r.check, r.channel) for r in lab.check(made)} == whole
        monkeypatch.undo()


def test_a_remark_of_several_records_comes_once():
    recording = spoilt(clean("random", 1), 0, SPOIL["dead"](None))
    twice = Recording(recording.records * 2, recording.inputs, recording.outputs, RATE)
    (remark,) = lab.check(twice)
    assert remark.evidence["records"] == 2


@pytest.mark.parametrize("n", [1, 2, 7, 40, 300])
def test_short_records_are_looked_at_without_fuss(n):
    recording = clean("random", 0).cut(0, n / RATE)
    assert {remark.check for remark in lab.check(recording)} <= {"dead"}


def test_every_check_tells_its_idea():
    for name, function in CHECKS.items():
        assert function.__doc__, name
