"""A study in words: what varies has a column, long values stay apart, and what is the same in every run is not told."""

from pathlib import Path

import numpy as np

from lab.studies.axes import Axis
from lab.studies.outcome import Outcome
from lab.studies.plan import Study
from lab.studies.statistics import Statistic
from lab.studies.wording import settings, study_summary, varied

LAYOUTS = (["acc1.x", "acc2.x", "acc4.x"], ["acc1.x", "acc2.x", "acc5.x"])


def outcome(*axes):
    study = Study("made up", {}, Path(), axes, 2)
    n, ones = study.n_points, np.ones(study.n_points)
    found = Statistic("modes_found", "share", 0.5 * ones, 0.1 * ones, 0.9 * ones, np.full(n, 2))
    return Outcome(study, (found,), {}, 0)


def rows(told):
    return [line.split() for line in told.splitlines()[4:]]


def test_a_key_with_one_value_is_no_column():
    told = outcome(Axis(("a.noise",), ((1.0, 2.0),)), Axis(("criteria",), (({},),)))
    assert varied(told) == ["a.noise"]
    assert [settings(told, point) for point in range(2)] == [[1.0], [2.0]]
    assert rows(study_summary(told)) == [["noise", "found"], ["1", "0.50"], ["2", "0.50"]]


def test_long_values_that_begin_alike_are_numbered():
    told = study_summary(outcome(Axis(("channels.outputs",), (LAYOUTS,))))
    assert "1) acc1.x, acc2… " in told
    assert "2) acc1.x, acc2… " in told


def test_long_values_that_differ_at_once_tell_how_many_they_are():
    told = study_summary(outcome(Axis(("channels.outputs",), ((LAYOUTS[0], LAYOUTS[1][:2]),))))
    assert "3: acc1.x, acc2… " in told
    assert "  acc1.x, acc2.x  " in told


def test_nothing_varied_is_one_row():
    assert rows(study_summary(outcome())) == [["found"], ["0.50"]]
