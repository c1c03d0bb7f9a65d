"""The verdict in one sentence, and the numbers of the tables."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.systems import SecondOrder
from lab.compare import Comparison
from lab.result import Criterion
from lab.show.tables import (
    criteria_rows,
    fixed,
    matrix_summary,
    matrix_tables,
    modes_table,
    same_dofs,
    with_std,
)
from lab.show.verdict import lowered, mode_rows, verdict
from tests.lab.showcase import chain_result, chain_rig


@pytest.fixture(scope="module")
def result():
    return chain_result(
        chain_rig("chain3_coupled", inputs=["force1"], outputs=["acc1.x", "acc2.x", "acc3.x"])
    )


def test_passed(result):
    found = verdict(result)
    assert found.outcome == "passed"
    assert found.sentence.startswith(
        "Passed: both criteria are met. 3 of 3 true modes found, frequencies within 0."
    )


def test_failed_names_what_is_missed_and_by_how_much(result):
    missed = Criterion("stiffness_error", 1e-8, 2.5e-3, False)
    absent = Criterion("mac", 0.9, None, False)
    found = verdict(replace(result, criteria=(result.criteria[0], missed, absent)))
    assert found.outcome == "failed"
    assert found.sentence == (
        "Failed: 2 of 3 criteria missed: stiffness error is 0.0025, required at most 1e-08; "
        "MAC could not be had, required at least 0.9."
    )


def test_without_truth_it_says_what_was_found(result):
    alone = replace(result, criteria=(), comparison=None, stable=(True, True, False))
    assert verdict(alone).outcome == "found"
    low, high = result.modes.frequency_hz[[0, -1]]
    expected = (
        f"3 modes were found between {low:.4g} and {high:.4g} Hz, 2 of them stable over the model orders."
    )
    assert verdict(alone).sentence == expected
    nothing = replace(alone, modes=result.modes.take([False] * 3), stable=())
    assert verdict(nothing).sentence == "No mode was found."


def test_missed_and_extra_modes_are_counted(result):
    pair = result.comparison.pairs[0]
    part = Comparison((pair,), missed=(1, 2), extra=(1, 2))
    sentence = verdict(replace(result, criteria=(), comparison=part)).sentence
    assert sentence.startswith("1 of 3 true modes found")
    assert "2 modes found that the model does not have" in sentence
    rows = mode_rows(replace(result, comparison=part))
    assert [row.number for row in rows] == [1, 2, 3, None, None]
    assert rows[3].true_frequency == result.truth_modes.frequency_hz[1]
    assert rows[3].frequency is None
    none = Comparison((), missed=(0, 1, 2), extra=())
    assert (
        verdict(replace(result, criteria=(), comparison=none)).sentence == "None of 3 true modes was found."
    )


def test_a_structure_without_damping_has_no_relative_damping_error(result):
    pairs = tuple(replace(pair, damping_error=math.inf) for pair in result.comparison.pairs)
    undamped = replace(result, criteria=(), comparison=replace(result.comparison, pairs=pairs))
    assert "damping" not in verdict(undamped).sentence.split(";")[0]
    assert {row[6] for row in modes_table(undamped).rows} == {"undefined"}


@given(mac=st.floats(0, 1))
def test_a_mac_is_never_rounded_up(mac):
    # The allowance is the rounding of a decimal number; 1 stands for what differs from 1 by rounding only.
    assert float(lowered(mac)) <= mac * (1 + 1e-15) + 1.0000001e-12


def test_criteria_table(result):
    rows = criteria_rows(
        replace(result, criteria=(Criterion("mac", 0.9, 1 - 3e-6, True), result.criteria[0]))
    )
    assert (rows[0].bound, rows[0].value, rows[0].outcome) == ("at least 0.9", "0.999997", "passed")
    assert rows[1].bound == "at most 0.1"


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1.23456789, 0.00123, "1.2346 ± 0.0012"),
        (123.4, 25.0, "123 ± 25"),
        (2.0, None, "2.00000"),
        (2.0, math.nan, "2.00000"),
        (2.0, 3e-12, "2.00000 ± 3.0e-12"),
        (None, None, ""),
    ],
)
def test_digits_follow_the_standard_deviation(value, std, text):
    assert with_std(value, std) == text


def test_stable_column_only_where_it_tells_something(result):
    assert "Stable" not in modes_table(result).heads
    mixed = modes_table(replace(result, stable=(True, False, True)))
    assert [row[mixed.heads.index("Stable")] for row in mixed.rows] == ["yes", "no", "yes"]


def test_matrix_entries_show_ten_digits_and_no_negative_zero():
    matrix = np.array([[2.0, -1e-17], [-1e-17, 0.8]])
    assert fixed(matrix, 10) == (("2.000000000", "0.000000000"), ("0.000000000", "0.800000000"))
    assert fixed(np.zeros((1, 1)), 10) == (("0.0",),)
    assert fixed(np.array([[1.5e-20]]), 3) == (("1.50e-20",),)


def test_matrices_are_matched_by_name_before_they_are_compared():
    truth = SecondOrder(np.diag([1.0, 2]), np.eye(2), np.diag([10.0, 20]), ("a", "b"))
    found = SecondOrder(np.diag([2.5, 1]), np.eye(2), np.diag([20.0, 10]), ("b", "a"))
    matched = same_dofs(truth, found.dofs)
    assert matrix_summary(found, matched)[0] == ("M [kg]", "2", "5.0e-01 at b, b", "2.5e-01")
    assert matrix_summary(found, matched)[2][3] == "0.0e+00"
    assert same_dofs(truth, ("a", "c")) is None
    tables = matrix_tables(replace(found, mass_std=np.full((2, 2), 0.1)), matched)
    assert [grid.name for grid in tables[0].tables] == [
        "recovered",
        "standard deviation",
        "true",
        "recovered - true",
    ]
    assert tables[0].tables[-1].rows == (("5.0e-01", "0"), ("0", "0"))
