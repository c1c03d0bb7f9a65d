"""Criteria: each kind of bound on each side of it."""

import pytest

from lab.compare import Comparison, Pair
from lab.criteria import judge
from lab.scenario import Criteria

COMPARISON = Comparison(
    pairs=(Pair(0, 0, -0.02, 0.3, 0.99), Pair(1, 2, 0.01, -0.4, 0.95)),
    missed=(2,),
    extra=(1,),
    mass_error=1e-3,
    damping_error=None,
    stiffness_error=1e-4,
)


@pytest.mark.parametrize(
    ("name", "reached", "met", "missed"),
    [
        ("modes", 2.0, 2, 3),
        ("frequency_error", 0.02, 0.02, 0.019),
        ("damping_ratio_error", 0.4, 0.4, 0.39),
        ("mac", 0.95, 0.95, 0.96),
        ("mass_error", 1e-3, 1e-3, 9e-4),
        ("stiffness_error", 1e-4, 1e-4, 0.0),
    ],
)
def test_bounds(name, reached, met, missed):
    for limit, passed in ((met, True), (missed, False)):
        (criterion,) = judge({name: limit, "modes": None} if name != "modes" else {name: limit}, COMPARISON)
        assert (criterion.name, criterion.limit, criterion.value) == (name, limit, reached)
        assert criterion.passed is passed


def test_what_was_not_reached_is_missed():
    (criterion,) = judge({"damping_error": 1.0}, COMPARISON)
    assert criterion.value is None
    assert not criterion.passed


def test_every_key_of_a_scenario_can_be_judged():
    limits = dict.fromkeys(Criteria.model_fields, 1.0)
    assert [criterion.name for criterion in judge(limits, COMPARISON)] == list(Criteria.model_fields)
