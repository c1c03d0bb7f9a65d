"""Axes: what a study file varies, and what comes out wrong is said in one line."""

import math
import tomllib
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab.errors import StudyError
from lab.studies.axes import Axis, Range, axes_of, changed
from tests.lab.studies.small import SCENARIO

TABLE = {
    **tomllib.loads(SCENARIO),
    "effects": [{"cause": "cubic_stiffness", "location": "spring2_3", "k3": 1.0}],
}


def axes(text):
    return axes_of(tomllib.loads(text)["vary"])


def test_a_table_makes_an_axis_of_each_key_with_or_without_quotes():
    bare = axes("[vary]\ntest.duration = [1.0, 2.0]\neffects.0.k3 = [3.0]")
    quoted = axes('[vary]\n"test.duration" = [1.0, 2.0]\n"effects.0.k3" = [3.0]')
    assert bare == quoted
    assert bare == (Axis(("test.duration",), ((1.0, 2.0),)), Axis(("effects.0.k3",), ((3.0,),)))


def test_keys_of_one_table_of_several_step_together():
    both, alone = axes("[[vary]]\na.b = [1, 2]\nc = [3, 4]\n[[vary]]\nd = [5]")
    assert [both.setting(k) for k in range(len(both))] == [{"a.b": 1, "c": 3}, {"a.b": 2, "c": 4}]
    assert alone.setting(0) == {"d": 5}


@given(st.integers(2, 50), st.floats(0.1, 10.0), st.floats(11.0, 1e6))
def test_a_log_range_has_equal_factors_and_exact_ends(count, first, last):
    values = Range(first=first, last=last, count=count, scale="log").values()
    assert (len(values), values[0], values[-1]) == (count, first, last)
    factor = (last / first) ** (1 / (count - 1))
    # A power and a division each round to a few units in the last place, over at most 50 steps.
    assert all(math.isclose(b / a, factor, rel_tol=1e-12) for a, b in pairwise(values))


def test_a_range_of_whole_steps_has_whole_numbers():
    values = Range(first=4, last=16, count=4).values()
    assert values == (4, 8, 12, 16)
    assert all(isinstance(value, int) for value in values)
    assert Range(first=0, last=1, count=3).values() == (0.0, 0.5, 1.0)


def test_a_setting_changes_its_keys_and_nothing_else():
    before = repr(TABLE)
    new = changed(TABLE, {"effects.0.k3": 5.0, "test.duration": 9.0, "criteria.modes": 2})
    assert (new["effects"][0]["k3"], new["test"]["duration"], new["criteria"]) == (5.0, 9.0, {"modes": 2})
    assert repr(TABLE) == before
    assert {key for key in new if new[key] != TABLE.get(key)} == {"effects", "test", "criteria"}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[vary]\nseed = 3", "seed = 3 in [vary]; expected a list of values, or a range"),
        ("[vary]\nseed = []", "seed = [] in [vary]; expected a list"),
        ("[vary]\nseed = [1, 2, 1]", "is twice in [vary]; expected once, and more runs by repeats"),
        (
            "[vary]\na = { first = 1, last = 2, cuont = 4 }",
            "unknown key 'cuont' at the top; allowed are first, last, count",
        ),
        (
            "[vary]\na = { first = 0, last = 2, count = 4, scale = 'log' }",
            "a log scale needs both ends above zero",
        ),
        ("[[vary]]\na = [1]\nb = [1, 2]", "need as many values each; a has 1, b has 2"),
        ("[[vary]]\na = [1]\n[[vary]]\na = [2]", "key 'a' in [[vary]] is varied twice"),
        ("[[vary]]", "[[vary]] is empty"),
    ],
)
def test_complaints(text, complaint):
    with pytest.raises(StudyError) as caught:
        axes(text)
    assert complaint in str(caught.value)


@pytest.mark.parametrize(
    ("path", "complaint"),
    [
        ("effects.1.k3", "no entry '1' in the list; positions are 0 to 0"),
        ("effects.x", "no entry 'x' in the list"),
        ("title.x", "'title' is a value, not a table"),
    ],
)
def test_paths_that_lead_nowhere(path, complaint):
    with pytest.raises(StudyError) as caught:
        changed(TABLE, {path: 1})
    assert complaint in str(caught.value)
