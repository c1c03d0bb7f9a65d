"""The summary: one screen, with the numbers that matter."""

from dataclasses import replace

import numpy as np
import pytest

from identification.modes import Modes
from identification.recording import Channel
from identification.systems import Realization, SecondOrder, StateSpace
from lab.compare import compare
from lab.result import Criterion, Result, Validation
from lab.summary import summary


def result(n_dofs, n_modes=None, **changes):
    n_modes = n_dofs if n_modes is None else n_modes
    outputs = tuple(Channel(f"acc{k}", "m/s^2", f"x{k}") for k in range(n_dofs))
    shapes = np.vander(np.arange(1.0, n_modes + 1), n_dofs).T
    modes = Modes(np.arange(1.0, n_modes + 1), np.full(n_modes, 0.0125), shapes, outputs)
    system = StateSpace(
        np.eye(2), np.zeros((2, 0)), np.zeros((n_dofs, 2)), np.zeros((n_dofs, 0)), 0.02, (), outputs
    )
    matrices = SecondOrder(
        np.diag(np.arange(1.0, n_dofs + 1)) + 1e-13,
        np.eye(n_dofs),
        7.5 * np.eye(n_dofs),
        tuple(channel.dof for channel in outputs),
    )
    fields = {
        "title": "A bridge",
        "sample_rate": 50.0,
        "modes": modes,
        "stable": (True,) * n_modes,
        "second_order": matrices,
        "realization": Realization("era", (system,), np.ones(3), 2, {}),
        "stabilization": None,
    }
    return Result(**(fields | changes))


def against(truth, found):
    return {
        "truth_modes": truth.modes,
        "truth_second_order": truth.second_order,
        "comparison": compare(truth.modes, found.modes, truth.second_order, found.second_order),
    }


def test_says_what_was_found():
    text = summary(result(2, warnings=("the record is short",), notes=("It was chosen.", "For a reason.")))
    assert text.startswith("A bridge\nera, order 2, sampled at 50 Hz\n")
    # Six digits, where nothing says how many are known.
    assert "  x0            1            0\n  x1            0            2\n" in text
    assert "7.5" in text
    assert "   1          1       1.25    yes\n   2          2       1.25    yes" in text
    assert "It was chosen. For a reason." in text
    assert text.endswith("warning: the record is short")
    assert "true" not in text


def test_lays_the_truth_beside_it():
    truth = result(3)
    heavy = SecondOrder(
        1.01 * truth.second_order.mass,
        truth.second_order.damping,
        truth.second_order.stiffness,
        ("x0", "x1", "x2"),
    )
    found = result(3, modes=truth.modes.take([0, 2]), stable=(True, False), second_order=heavy)
    judged = (Criterion("mass_error", 1e-3, 0.01, False), Criterion("mac", 0.9, None, False))
    text = summary(
        result(
            3,
            modes=found.modes,
            stable=found.stable,
            second_order=heavy,
            criteria=judged,
            **against(truth, found),
        )
    )
    assert "M [kg]   largest error / largest entry 1.0e-02" in text
    assert "K [N/m]   largest error / largest entry 0.0e+00" in text
    assert "2 of 3 true modes found" in text
    assert "MISSED mass_error: 0.01 (limit 0.001)" in text
    assert "MISSED mac: not available (limit 0.9)" in text


@pytest.mark.parametrize(
    ("std", "printed"),
    [(0.02, "1.235"), (2e-5, "1.234568"), (0.0, "1.23456789"), (np.inf, "1.23457"), (3.0, "1.23")],
)
def test_digits_are_those_that_the_error_bars_support(std, printed):
    """Two of the largest error bar's own digits, at least three and at most ten in all; six where nothing is known."""
    matrices = SecondOrder(
        np.array([[1.23456789]]), np.eye(1), np.eye(1), ("x0",), *([np.full((1, 1), std)] * 3)
    )
    row = summary(result(1, second_order=matrices)).split("M [kg]")[1].splitlines()[1]
    assert row.split() == ["x0", printed]


def test_modes_have_their_error_bars():
    plain = result(2)
    barred = replace(plain.modes, frequency_std=np.array([0.00123, 0.2]), damping_std=np.array([1e-4, 0.0]))
    lines = summary(result(2, modes=barred)).splitlines()
    row = next(line for line in lines if line.startswith("   1 "))
    assert row.split() == ["1", "1", "0.0012", "1.25", "0.01", "yes"]
    head = next(line for line in lines if line.startswith("mode "))
    assert head.split() == ["mode", "Hz", "±", "damping", "%", "±", "stable"]


@pytest.mark.parametrize("n_dofs", [1, 5, 8, 9, 40])
def test_fits_a_screen(n_dofs):
    truth, std = result(n_dofs, 40), np.full(40, 9.9e-12)
    barred = replace(truth.modes, frequency_std=std, damping_std=std)
    found = result(n_dofs, 40, modes=barred)
    text = summary(replace(found, **against(truth, found)))
    assert len(text.splitlines()) < 60
    assert max(map(len, text.splitlines())) <= 100


def test_validation_counts_and_names_what_was_not_passed():
    def judged(name, outcome, value, where):
        return Validation(name, 0.9, True, value, None, outcome, where, "a standard")

    long = "needs the model's masses and shapes at more points than modes"
    validation = (
        judged("frequency error of the lowest mode", "pass", 0.95, "mode 1"),
        judged("MAC", "fail", 0.12345, "mode 2"),
        judged("cross-orthogonality, same mode", "undecided", None, long),
    )
    text = summary(result(2, validation=validation))
    lines = text.split("validation: ")[1].splitlines()
    assert lines[0] == "1 pass, 1 fail, 1 undecided"
    assert lines[1] == "  fail      MAC: 0.123 (at least 0.9; mode 2)"
    assert lines[2].startswith("  undecided cross-orthogonality, same mode: not available (at least 0.9;")
    assert max(map(len, text.splitlines())) <= 100
    assert "validation" not in summary(result(2))


def test_nothing_found():
    none = result(2).modes.take(np.zeros(2, dtype=bool))
    assert "no mode found" in summary(result(2, modes=none, stable=(), second_order=None))
