"""What a recording cannot tell is said before any fit, and only that."""

from dataclasses import replace

import numpy as np
import pytest

from identification.recording import Record, Recording
from lab.diagnosis.check import check, listed, living
from lab.errors import LabError
from lab.rig import Rig
from tests.lab.structures import chain_xml

RATE, N = 50.0, 2000


@pytest.fixture(scope="module")
def rig():
    # Frequencies 2.3 and 6.0 Hz, about 1 % damped.
    xml = chain_xml([1.0, 2.0], [(400.0, 1.0), (0.0, 0.0)], {(0, 1): (900.0, 1.5)})
    return Rig.from_xml(xml).connected(inputs=["force0", "force1"], outputs=["acc0.x", "pos1"])


def recorded(rig, u, rate=RATE):
    y = np.random.default_rng(1).standard_normal((2, u.shape[1]))
    return Recording((Record("random", u, y),), rig.inputs, rig.outputs, rate)


def white(n=N):
    return np.random.default_rng(0).standard_normal((2, n))


def test_a_good_test_leaves_nothing_to_say(rig):
    assert check(recorded(rig, white()), rig) == ()


def test_a_channel_that_never_moves(rig):
    u = white()
    u[1] = 0.0
    (said,) = check(recorded(rig, u), rig)
    assert said.startswith("input force1 never changes")
    good = recorded(rig, white())
    y = np.array(good.records[0].outputs)
    y[0] = 3.0
    (said,) = check(replace(good, records=(replace(good.records[0], outputs=y),)), rig)
    assert said.startswith("output acc0.x never changes")


@pytest.mark.parametrize("value", [0.0, 3.0, np.nan])
def test_an_output_that_never_changes_is_left_out(rig, value):
    good = recorded(rig, white())
    assert living(good) == (good, ())
    y = np.array(good.records[0].outputs)
    y[0], y[1, 7] = value, np.nan
    broken = replace(good, records=(replace(good.records[0], outputs=y),))
    for kept, said in (living(broken), living(good, broken)):
        assert [channel.name for channel in kept.outputs] == ["pos1"]
        assert said == ("output acc0.x never changes: it was left out; check the channel",)


def test_nothing_that_changes_is_refused(rig):
    good = recorded(rig, white())
    still = replace(good.records[0], outputs=np.zeros((2, N)))
    with pytest.raises(LabError, match="no output ever changes"):
        living(replace(good, records=(still,)))
    # Fits see 1400 samples.
    for side, signal in (("outputs", good.records[0].outputs), ("inputs", good.records[0].inputs)):
        late = replace(good.records[0], **{side: np.where(np.arange(N) < 1400, 0.0, signal)})
        with pytest.raises(LabError, match="changes in the first 70 % of any record"):
            living(replace(good, records=(late,)))
    unmoved = replace(good.records[0], inputs=np.zeros((2, N)))
    with pytest.raises(LabError, match=r"input force0 and force1 never changes.*free_decay"):
        living(replace(good, records=(unmoved,)))
    decay = replace(unmoved, kind="free_decay")
    assert living(replace(good, records=(unmoved, decay)))[1] == ()


def test_samples_that_cannot_be_used_are_refused(rig):
    good = recorded(rig, white())
    record = good.records[0]

    def changed(**sides):
        return replace(good, records=(replace(record, **sides),))

    def broken(signal, where, value):
        signal = np.array(signal)
        signal[where] = value
        return signal

    for sides, message in (
        (
            {"inputs": broken(record.inputs, (1, 7), np.nan)},
            r"input force1 is missing in sample 7 of record 0",
        ),
        ({"inputs": broken(record.inputs, (0, 9), np.inf)}, r"input force0 is infinite in sample 9"),
        ({"outputs": broken(record.outputs, (1, 5), -np.inf)}, r"output pos1 is infinite in sample 5"),
        (
            {"outputs": broken(record.outputs, np.s_[:, 1400:], np.nan)},
            "behind the first 70 % of each record is missing",
        ),
        (
            {side: getattr(record, side)[:, :142] for side in ("inputs", "outputs")},
            "99 samples; expected at least 100",
        ),
    ):
        with pytest.raises(LabError, match=message):
            living(changed(**sides))


def test_modes_beyond_half_the_sample_rate(rig):
    highest = rig.second_order().modes().frequency_hz[-1]
    (said,) = check(recorded(rig, white(), rate=1.9 * highest), rig)
    assert f"{highest:.4g} Hz lie beyond half the sample rate" in said
    assert check(recorded(rig, white(), rate=2.1 * highest), rig) == ()


def test_a_record_without_one_swing(rig):
    lowest = rig.second_order().modes().frequency_hz[0]
    n = int(0.9 * RATE / lowest)
    said = check(recorded(rig, white(n)), rig)
    assert any("record longer" in each for each in said)
    assert not any("record longer" in each for each in check(recorded(rig, white(2 * n)), rig))


def test_two_shakers_on_one_signal(rig):
    u = white()
    u[1] = -2 * u[0]
    (said,) = check(recorded(rig, u), rig)
    assert said.startswith("the inputs force0 and force1 drive as one signal")
    u[1] += 1e-3 * white()[1]
    assert check(recorded(rig, u), rig) == ()


def test_a_band_that_leaves_a_mode_out(rig):
    t = np.arange(N) / RATE
    # Whole periods in the record, so that no power leaks; 0.5 to 3 Hz holds the lower mode alone.
    lines = np.arange(20, 120) / (N / RATE)
    phases = np.random.default_rng(2).uniform(0, 2 * np.pi, (2, lines.size, 1))
    u = np.sum(np.cos(2 * np.pi * lines[:, None] * t + phases), axis=1)
    lower, upper = rig.second_order().modes().frequency_hz
    assert lower < lines[-1] < 0.8 * upper
    (said,) = check(recorded(rig, u), rig)
    assert f"next to no power at the model's modes at {upper:.4g} Hz" in said


def test_names_in_a_sentence():
    assert listed(["a"]) == "a"
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed(list("abcdefg")) == "a, b, c, d, e and 2 more"
