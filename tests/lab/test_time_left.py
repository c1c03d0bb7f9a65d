"""The time left, at a pace that is known."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab.cli.time_left import LEAST, SOONEST, TimeLeft, in_words, told


@given(st.floats(0, 0.9), st.floats(0.05, 0.95), st.floats(5, 1e5))
def test_at_a_steady_pace_the_time_left_is_right(first, done, total):
    """Work that takes `total` seconds from a share `first` on: after a share `done` of it, the rest is left."""
    left = TimeLeft(first, 100.0)
    passed = done * total
    left.reached(first + done * (1 - first), 100.0 + passed)
    if passed < SOONEST:
        assert left.seconds(100.0 + passed) is None
    else:
        # The share is a difference of rounded numbers, up to ten times as large.
        assert left.seconds(100.0 + passed) == pytest.approx((1 - done) * total, rel=1e-9, abs=1e-9)


def test_between_two_shares_it_runs_down_and_waits_at_zero():
    left = TimeLeft(0.0, 0.0)
    left.reached(0.5, 10.0)
    assert [left.seconds(now) for now in (10.0, 14.0, 20.0, 35.0)] == [10.0, 6.0, 0.0, 0.0]
    left.reached(0.4, 36.0)
    assert left.share == 0.5


def test_too_early_nothing_is_promised():
    left = TimeLeft(0.0, 0.0)
    assert left.seconds(50.0) is None
    left.reached(0.5 * LEAST, 50.0)
    assert left.seconds(50.0) is None
    left = TimeLeft(0.0, 0.0)
    left.reached(0.5, 0.5 * SOONEST)
    assert left.seconds(3.0) is None


def test_all_done_nothing_is_left():
    left = TimeLeft(1.0, 0.0)
    assert left.share_of_rest == 1.0


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "0:00"), (59.6, "1:00"), (65, "1:05"), (3605, "1:00:05"), (360000, "100:00:00")],
)
def test_times_read_as_on_a_clock(seconds, words):
    assert in_words(seconds) == words


def test_what_is_told():
    assert told(65.0, 3.0) == "1:05 left"
    assert told(None, 12.0) == "0:12 so far"
    assert told(None, 0.4) == ""
