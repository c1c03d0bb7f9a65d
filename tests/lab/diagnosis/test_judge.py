"""A diagnosis is held against what was hidden: each way to be right or wrong."""

import math
from dataclasses import replace

import pytest

from lab.diagnosis.judge import judge_diagnosis
from lab.diagnosis.outcome import Quantity
from lab.effects import EFFECTS
from tests.lab.diagnosed import explained, recorded, two_masses


@pytest.fixture(scope="module")
def diagnosis():
    """A cubic spring of (5.00 ± 0.04) 1e6 N/m^3 at spring0_1."""
    rig = two_masses()
    return explained(rig, recorded(rig, n_records=1))


def cubic(k3=5e6, location="spring0_1"):
    return EFFECTS["cubic_stiffness"](location, k3=k3)


def judged(*arguments, **options):
    return {c.name: c for c in judge_diagnosis(*arguments, **options)}


def test_all_right(diagnosis):
    found = judged(diagnosis, [cubic(5e6 + 3 * 4e4)])
    assert all(c.passed for c in found.values())
    assert found["parameter_error"].value == pytest.approx(3.0)
    assert list(found) == ["verdict_right", "effects_found", "effects_misnamed", "parameter_error"]


@pytest.mark.parametrize(
    ("hidden", "missed"),
    [
        ([cubic(5e6 + 5 * 4e4)], {"parameter_error"}),
        ([cubic(location="mass0")], {"effects_found", "effects_misnamed", "parameter_error"}),
        ([cubic(), EFFECTS["sensor_gain"]("pos1", relative_change=0.1)], {"effects_found"}),
        ([], {"verdict_right", "effects_misnamed"}),
    ],
)
def test_each_way_to_be_wrong(diagnosis, hidden, missed):
    assert {c.name for c in judge_diagnosis(diagnosis, hidden) if not c.passed} == missed


def test_the_verdict_may_be_asked_for(diagnosis):
    assert not judged(diagnosis, [cubic()], verdict="unexplained")["verdict_right"].passed
    left = replace(diagnosis, verdict="unexplained")
    assert judged(left, [cubic()], verdict="unexplained")["verdict_right"].passed


def test_an_error_bar_of_nothing_forgives_nothing(diagnosis):
    (finding,) = diagnosis.findings
    sure = replace(finding, parameters={"k3": Quantity(5e6, 0.0, "N/m^3")})
    exact = replace(diagnosis, findings=(sure,))
    assert judged(exact, [cubic()])["parameter_error"].value == 0.0
    assert judged(exact, [cubic(4e6)])["parameter_error"].value == math.inf
