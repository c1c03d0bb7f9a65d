"""A name is given to what acts as it says."""

import numpy as np
import pytest

from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.plausible import plausible
from lab.effects import EFFECTS
from lab.effects.survey import Guess

BAND = (0.1, 10.0)


@pytest.mark.parametrize(
    ("cause", "location", "values", "named"),
    [
        ("missing_spring", "mass1|mass3", {"stiffness": 2.0}, True),
        ("missing_spring", "mass1|mass3", {"stiffness": -2.0}, False),
        ("quadratic_damping", "spring1_2", {"c2": 0.3}, True),
        ("quadratic_damping", "spring1_2", {"c2": -0.3}, False),
        ("cubic_stiffness", "spring1_2", {"k3": -0.3}, True),  # springs may soften
        ("sensor_gain", "acc1.x", {"relative_change": -2.0}, True),  # and cables be swapped
    ],
)
def test_springs_hold_and_drag_brakes(cause, location, values, named):
    scale = dict.fromkeys(values, 1.0)
    hypothesis = Hypothesis(
        EFFECTS[cause], location, Guess(dict.fromkeys(values, 0.0), scale), np.array(list(values.values()))
    )
    assert plausible(hypothesis, BAND) is named
    # Where a fit starts, nothing is decided yet.
    assert plausible(hypothesis.at(np.zeros(1)), BAND)


@pytest.mark.parametrize(("travels", "named"), [(0.5, True), (5.0, True), (50.0, False)])
def test_a_memory_yields_within_reach_or_is_a_spring(travels, named):
    scale = {"stiffness": 100.0, "yield_displacement": 0.01}
    guess = Guess({"stiffness": 10.0, "yield_displacement": 0.01 * travels}, scale)
    assert plausible(Hypothesis.starting(EFFECTS["hysteresis"], "spring1_2", guess), BAND) is named
