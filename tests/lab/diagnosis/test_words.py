"""What was found, in sentences: which measurement tells two causes apart, and only where the data do not."""

from lab.diagnosis.outcome import Alternative, Errors
from lab.diagnosis.words import ALIKE, advice, inseparable, no_gain
from lab.effects import EFFECTS


def test_causes_that_look_alike_exist():
    assert {cause for pair in ALIKE for cause in pair} <= set(EFFECTS)


def test_advice_where_the_evidence_is_close_and_nowhere_else():
    assert advice("cubic_stiffness", "gap_contact", 5.1) == ""
    said = advice("cubic_stiffness", "gap_contact", 0.3)
    assert said == "these data cannot separate it from cubic stiffness: repeat the test at a higher level"
    assert "another input, level or one more sensor" in advice("freeplay", "line_hum", 0.0)
    assert advice("mass_change", "mass_change", 0.3).startswith(
        "these data cannot separate it from the same elsewhere: "
    )


def test_advice_where_the_evidence_is_no_more_certain_than_chance():
    assert advice("cubic_stiffness", "gap_contact", 9.0, chance=8.9) == ""
    assert advice("cubic_stiffness", "gap_contact", 9.0, chance=9.1) != ""


def test_a_name_without_gain_says_both_errors():
    said = no_gain(Errors(noise_floor=0.1, nominal=1.02, calibrated=0.998, extended=1.73))
    assert "173 % of the signal" in said
    assert "99.8 %" in said


def test_a_warning_for_each_pair_that_cannot_be_told_apart():
    close = Alternative(
        "gap_contact", "spring1|spring2", 10.0, "these data cannot separate it from this: do that"
    )
    (said,) = inseparable([Alternative("freeplay", "spring1", 1.0), close])
    assert said == (
        "gap contact at spring1 and spring2 would explain the first finding about as well: these data cannot separate it from "
        "this: do that"
    )
