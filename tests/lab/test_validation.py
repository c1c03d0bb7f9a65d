"""Criteria of the field: outcomes from errors and error bars made by hand, orthogonality from exact modes."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from identification.modes import Modes
from lab.compare import compare
from lab.orthogonality import cross_orthogonality
from lab.scenario import make_scenario
from lab.validation import Limits, validate
from tests.lab.showcase import chain_result, chain_rig

LOWEST, OTHERS = "frequency error of the lowest mode", "frequency error of the other modes"
FREQUENCY = "frequency: comparison error over validation uncertainty"
DAMPING = "damping: comparison error over validation uncertainty"
OWN, OFF = "cross-orthogonality, same mode", "cross-orthogonality, other modes"


def made(factors, std, *, damping=1.0, outputs=None, model="chain3_uncoupled"):
    """The exact modes of three masses with frequencies off by known factors, and relative error bars."""
    rig = chain_rig(model, inputs=["force1"], outputs=outputs or ["pos1", "pos2", "pos3"])
    truth = rig.modes()
    f = truth.frequency_hz * np.asarray(factors)
    stds = (None, None) if std is None else (std * truth.frequency_hz, std * truth.damping_ratio)
    modes = Modes(f, truth.damping_ratio * damping, truth.shapes, truth.outputs, *stds)
    result = replace(chain_result(rig), modes=modes, truth_modes=truth, second_order=None)
    return replace(result, comparison=compare(truth, modes, rig.second_order(), None))


def outcomes(result, limits=None, **settings):
    return {each.name: each for each in validate(result, limits, **settings)}


@pytest.mark.parametrize(
    ("factor", "std", "lowest", "others"),
    [
        (1.02, None, "pass", "pass"),
        (0.96, None, "fail", "pass"),  # 4 %: beyond 3, within 5
        (1.06, 1e-4, "fail", "fail"),
        (1.02, 0.01, "undecided", "pass"),  # 2 % ± 2 %: holds 3 %; below 5 %
        (1.04, 0.01, "undecided", "undecided"),  # 2 to 6 %
    ],
)
def test_a_frequency_passes_fails_or_stays_open(factor, std, lowest, others):
    found = outcomes(made([factor] * 3, std))
    assert (found[LOWEST].outcome, found[OTHERS].outcome) == (lowest, others)
    assert found[LOWEST].value == pytest.approx(abs(factor - 1), rel=1e-9)  # rounding of a difference
    assert found[LOWEST].std == (None if std is None else pytest.approx(std))


def test_the_worst_outcome_decides_not_the_largest_error():
    """Mode 2 is surely out by 6 %; mode 3 seems out by 7 % but may be in."""
    result = made([1.0, 1.06, 1.07], 0.001)
    stds = result.modes.frequency_std * np.array([1, 1, 20])
    modes = result.modes
    wide = Modes(
        modes.frequency_hz, modes.damping_ratio, modes.shapes, modes.outputs, stds, modes.damping_std
    )
    found = outcomes(replace(result, modes=wide))
    assert (found[OTHERS].outcome, found[OTHERS].where) == ("fail", "mode 2")


def test_the_comparison_error_is_held_against_its_uncertainty():
    """An error of one standard deviation is chance; of three it is not; the simulation's own error widens the bar."""
    assert outcomes(made([1.01] * 3, 0.01))[FREQUENCY].value == pytest.approx(1.0)
    assert outcomes(made([1.01] * 3, 0.01))[FREQUENCY].outcome == "pass"
    assert outcomes(made([1.03] * 3, 0.01))[FREQUENCY].outcome == "fail"
    assert outcomes(made([1.03] * 3, 0.01), numerical_error=0.05)[FREQUENCY].outcome == "pass"
    unknown = outcomes(made([1.0] * 3, None))
    assert unknown[FREQUENCY].outcome == unknown[DAMPING].outcome == "undecided"
    assert outcomes(made([1.0] * 3, 0.0))[FREQUENCY].outcome == "undecided"
    assert outcomes(made([1.0] * 3, 0.1, damping=1.3))[DAMPING].value == pytest.approx(3.0)


def test_chance_exceeds_the_limit_as_rarely_as_two_standard_deviations():
    """Of normal errors of three modes, 4.55 % lie beyond the limit: within four standard errors of 4000 draws."""
    limit = outcomes(made([1.0] * 3, 0.01))[FREQUENCY].limit
    draws = np.sqrt(np.mean(np.random.default_rng(0).standard_normal((4000, 3)) ** 2, axis=1))
    assert abs(np.mean(draws > limit) - 0.0455) < 4 * np.sqrt(0.0455 * 0.9545 / 4000)


def test_exact_modes_are_orthogonal():
    found = cross_orthogonality(made([1.0] * 3, None))
    np.testing.assert_allclose(np.abs(found.values), np.eye(3), atol=1e-12)  # rounding
    assert found.dofs == ("x1", "x2", "x3")


def test_reduction_to_fewer_points_is_that_of_guyan():
    """Two sensors on three masses: the mass seen there, from eliminating the third coordinate by hand."""
    result = made([1.0] * 3, None, outputs=["pos1", "pos3"])
    kept = replace(result.comparison, pairs=result.comparison.pairs[:2])
    found = cross_orthogonality(replace(result, comparison=kept))
    M, K = result.truth_second_order.mass, result.truth_second_order.stiffness
    # x2 follows x1 and x3 as a spring without mass would.
    T = np.array([[1.0, 0.0], [-K[1, 0] / K[1, 1], -K[1, 2] / K[1, 1]], [0.0, 1.0]])
    reduced = T.T @ M @ T
    shapes = scipy.linalg.eigh(K, M)[1][[0, 2]][:, :2]
    unit = shapes / np.sqrt(np.diagonal(shapes.T @ reduced @ shapes))
    np.testing.assert_allclose(np.abs(found.values), np.abs(unit.T @ reduced @ unit), atol=1e-10)
    assert (found.dofs, found.n_dofs) == (("x1", "x3"), 3)


def test_too_few_points_leave_orthogonality_open():
    found = outcomes(made([1.0] * 3, None, outputs=["pos1", "pos3"]))
    assert (found[OWN].outcome, found[OFF].outcome) == ("undecided", "undecided")
    assert found["MAC"].outcome == "pass"


def test_wrong_shapes_fail():
    """Modes 1 and 2 exchanged shapes: neither MAC nor orthogonality lets that pass."""
    result = made([1.0] * 3, None)
    modes = replace(result.modes, shapes=result.modes.shapes[:, [1, 0, 2]])
    found = outcomes(replace(result, modes=modes))
    assert (found[OWN].outcome, found[OFF].outcome) == ("fail", "fail")
    assert found[OFF].value == pytest.approx(1.0)


def test_limits_are_set_in_the_scenario():
    table = {
        "title": "t",
        "model": "m.xml",
        "test": {"sample_rate": 1.0, "duration": 1.0},
        "excitation": {"kind": "pulse", "amplitude": 1.0},
        "validation": {"first_frequency_error": 0.01, "mac": 0.99},
    }
    assert make_scenario(table).validation.limits() == Limits(first_frequency_error=0.01, mac=0.99)
    strict = outcomes(made([1.02] * 3, None), Limits(first_frequency_error=0.01))
    assert strict[LOWEST].outcome == "fail"


def test_without_a_model_or_a_pair_there_is_nothing_to_judge():
    result = made([1.0] * 3, None)
    assert validate(replace(result, comparison=None)) == ()
    assert validate(replace(result, comparison=replace(result.comparison, pairs=()))) == ()
    missing = replace(result, comparison=replace(result.comparison, pairs=result.comparison.pairs[1:]))
    assert outcomes(missing)[LOWEST].outcome == "undecided"


def test_a_structure_without_damping_has_no_relative_damping_error():
    result = made([1.01] * 3, 0.01)
    none = replace(result.truth_modes, damping_ratio=np.zeros(3))
    still = replace(result, truth_modes=none, comparison=compare(none, result.modes))
    found = outcomes(still)
    assert (found[DAMPING].outcome, found[DAMPING].value) == ("undecided", None)
    assert found[FREQUENCY].outcome == "pass"
