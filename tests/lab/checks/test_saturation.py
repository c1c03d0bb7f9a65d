"""Readings that level off while another channel goes on, and motions that only look so."""

import numpy as np
import pytest

import lab
from identification.recording import Channel, Record, Recording
from lab.checks.saturation import bend_of, saturation
from lab.checks.survey import Survey
from tests.lab.checks.benches import KINDS, clean

T = np.linspace(0.0, 60.0, 12_000)
SLOW = 5 * np.sin(2 * np.pi * T / 17) + 3 * np.sin(2 * np.pi * T / 7.3 + 1)


def recorded(u, y, noise=0.05, seed=1):
    rng = np.random.default_rng(seed)
    y = y + noise * rng.standard_normal(y.size)
    channels = (Channel("voltage", "V"),), (Channel("current", "A"),)
    return Recording((Record("other", u[None], y[None]),), *channels, 200.0)


@pytest.mark.parametrize(("limit", "sign"), [(2.5, 1), (3.5, 1), (2.5, -1)])
def test_a_level_under_noise_is_found_at_either_end(limit, sign):
    made = recorded(SLOW, sign * np.minimum(SLOW, limit))
    found = [r for r in lab.check(made) if r.check == "saturation" and r.channel == "current"]
    (remark,) = found
    # The median of what lies beyond: few cells of 12 samples, some of which are at the bend.
    assert remark.evidence["level"] == pytest.approx(sign * limit, abs=0.05)
    beyond = T[limit + 1.5 < SLOW]
    assert remark.start < beyond[0]
    assert remark.stop > beyond[-1]


def test_equal_readings_without_noise_are_found_as_well():
    made = recorded(SLOW, np.minimum(SLOW, 2.5), noise=0.0)
    assert [r.check for r in saturation(Survey(made))] == ["saturation"]


MOTIONS = {
    "follows all along": SLOW,
    "hardens to a fifth": np.where(SLOW > 2, 2 + 0.2 * (SLOW - 2), SLOW),
    "a sine a little late": np.roll(SLOW, 60),
    "a sine in quadrature": np.gradient(SLOW),
    "a square": np.sign(SLOW),
    "cubic": SLOW**3 / 50,
    "arctangent": np.arctan(SLOW / 4),
    "clearance about zero": np.sign(SLOW) * np.maximum(np.abs(SLOW) - 2, 0),
}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_what_bends_otherwise_is_no_saturation(motion, noise):
    assert saturation(Survey(recorded(SLOW, MOTIONS[motion], noise))) == []


@pytest.mark.parametrize("period", [0.05, 0.3, 2.0, 11.0, 60.0, 500.0])
@pytest.mark.parametrize("lag", [0.0, 0.1, 0.5, 1.6])
def test_a_sine_piles_up_at_its_ends_and_is_clean(period, lag):
    u, y = np.sin(2 * np.pi * T / period), np.sin(2 * np.pi * T / period - lag)
    assert saturation(Survey(recorded(u, y, 0.01))) == []


@pytest.mark.parametrize("kind", KINDS)
def test_clean_recordings_have_none(kind):
    for seed in range(3):
        assert saturation(Survey(clean(kind, 500 + seed))) == []


def test_too_few_cells_tell_nothing():
    u = np.arange(30.0)
    assert bend_of(u, np.minimum(u, 15)) is None
    assert bend_of(np.zeros(100), np.arange(100.0)) is None
    assert bend_of(np.arange(100.0), np.full(100, np.nan)) is None
