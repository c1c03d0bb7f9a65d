"""Progress: parts of a whole, told in order."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.progress import UNHEARD, Work

COST = st.floats(0.01, 100.0)


@given(st.lists(st.tuples(COST, st.integers(1, 6)), min_size=1, max_size=6))
def test_parts_fill_the_whole_one_after_the_other(plan):
    told = []
    work = Work(lambda what, share: told.append(share))
    for part, (_, n) in zip(work.parts(*[cost for cost, _ in plan]), plan, strict=True):
        assert list(part.each(range(n))) == list(range(n))
    # Each step tells once; rounding of sums may take back some last digits.
    assert len(told) == sum(n for _, n in plan)
    assert all(after >= before - 1e-12 for before, after in pairwise(told))
    assert told[-1] == pytest.approx(1.0, abs=1e-12)


def test_a_part_is_as_long_as_it_costs():
    told = []
    first, second = Work(lambda *each: told.append(each)).parts(1.0, 3.0)
    first.called("reading").done()
    inner = second.called("fitting").parts(1.0, 2.0)[1]
    inner.done(0.5)
    assert told == [
        ("reading", 0.0),
        ("reading", 0.25),
        ("fitting", 0.25),
        # A quarter, then three quarters times one third and half of two thirds.
        ("fitting", pytest.approx(0.25 + 0.75 * (1 / 3 + 1 / 3))),
    ]


def test_work_listens_to_what_it_consists_of():
    told = []
    half = Work(lambda *each: told.append(each)).parts(1.0, 1.0)[1]
    Work(half).called("inside").done(0.5)
    assert told == [("inside", 0.5), ("inside", 0.75)]


def test_of_items_without_length_the_number_is_given():
    told = []
    assert list(Work(lambda _, share: told.append(share)).each(iter("abcd"), 4)) == list("abcd")
    assert told == [0.25, 0.5, 0.75, 1.0]


def test_what_costs_nothing_is_passed_over():
    nothing, all_ = Work().parts(0.0, 2.0)
    assert (nothing.start, nothing.end, all_.start, all_.end) == (0.0, 0.0, 0.0, 1.0)


def test_nobody_listening_items_come_as_they_are():
    endless = iter(int, 1)
    assert next(UNHEARD.each(endless)) == 0
    UNHEARD.called("anything").done()
