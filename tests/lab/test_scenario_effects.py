"""Scenarios that hide effects: read strictly, applied before the instruments, and held against the right truth."""

import numpy as np
import pytest

from lab.effects import EFFECTS
from lab.errors import StudyError, UnknownNameError
from lab.run import model_of, rig_of, truth_of
from lab.scenario import load_scenario

HEAD = """
title = "Something is hidden"
model = "chain3_uncoupled.xml"

[test]
sample_rate = 5.0
duration = 10.0

[excitation]
kind = "random"

[channels]
inputs = ["force1"]
outputs = ["acc1.x", "acc3.x"]

[instruments]
noise_percent = 1.0
"""
SOFT = '[[effects]]\ncause = "stiffness_change"\nlocation = "spring2_3"\nrelative_change = -0.5\n'
LATE = '[[effects]]\ncause = "sensor_delay"\nlocation = "acc3.x"\ndelay = 0.1\n'
HARD = '[[effects]]\ncause = "cubic_stiffness"\nlocation = "spring2_3"\nk3 = 4\n'


def scenario(tmp_path, *tables):
    path = tmp_path / "scenario.toml"
    path.write_text(HEAD + "".join(tables), encoding="utf-8")
    return load_scenario(path)


def test_effects_are_read_in_their_order(tmp_path):
    hidden = scenario(tmp_path, SOFT, LATE).hidden()
    assert hidden == (
        EFFECTS["stiffness_change"]("spring2_3", relative_change=-0.5),
        EFFECTS["sensor_delay"]("acc3.x", delay=0.1),
    )
    assert scenario(tmp_path).hidden() == ()


def test_the_rig_has_the_effects_and_its_instruments(tmp_path):
    rig = rig_of(scenario(tmp_path, SOFT, LATE))
    model = model_of(scenario(tmp_path, SOFT, LATE))
    x2_x3 = (1, 2)
    # The spring between masses 2 and 3 is 1 N/m; half of it is gone.
    assert (rig.second_order().stiffness - model.second_order().stiffness)[x2_x3] == pytest.approx(
        0.5, abs=1e-12
    )
    assert [stage.name for stage in rig.chain.for_channel("sensors", "acc3.x")] == ["delay"]
    assert [stage.name for stage in rig.chain.for_channel("acquisition", "acc3.x")] == ["noise"]


def test_truth_is_what_was_simulated_as_long_as_it_is_linear(tmp_path):
    soft = scenario(tmp_path, SOFT)
    rig = rig_of(soft)
    assert truth_of(soft, rig) is rig
    hard = scenario(tmp_path, SOFT, HARD)
    np.testing.assert_array_equal(
        truth_of(hard, rig_of(hard)).second_order().stiffness, model_of(hard).second_order().stiffness
    )


@pytest.mark.parametrize(
    ("table", "says"),
    [
        (
            HARD.replace("cubic_stiffness", "cubic"),
            r"cause = 'cubic' in \[effects\]; expected one of mass_change,",
        ),
        (HARD.replace("k3", "k4"), r"unknown key 'k4' in \[effects\]; allowed are cause, location, k3"),
        (HARD.replace("k3 = 4\n", ""), r"key 'k3' is missing in \[effects\]"),
        (
            HARD.replace("location", "place"),
            r"unknown key 'place' in \[effects\]; allowed are cause, location, k3",
        ),
        (HARD.replace("= 4", '= "4"'), r"k3 = '4' in \[effects\]: input should be a valid number"),
        (HARD.replace('cause = "cubic_stiffness"\n', ""), r"key 'cause' is missing in \[effects\]"),
        (HARD.replace("[[effects]]", "[effects]"), r"effects = .*list"),
    ],
)
def test_a_wrong_table_is_one_line(tmp_path, table, says):
    with pytest.raises(StudyError, match=says) as caught:
        scenario(tmp_path, table)
    assert "\n" not in str(caught.value)


def test_a_place_that_does_not_exist(tmp_path):
    with pytest.raises(UnknownNameError, match=r"spring 'spring9' does not exist.*spring2_3"):
        rig_of(scenario(tmp_path, HARD.replace("spring2_3", "spring9")))
