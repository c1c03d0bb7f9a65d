"""result.json: plain JSON that says what the result says."""

import json

import numpy as np
import pytest

from identification.modes import Modes
from identification.recording import Channel
from identification.systems import Realization, SecondOrder, StateSpace
from lab.compare import compare
from lab.errors import FileError
from lab.files.results import load_result, save_result
from lab.result import Criterion, Result

OUTPUTS = (Channel("acc1.x", "m/s^2", "x1"), Channel("acc2.x", "m/s^2", "x2"))


def result(**changes):
    modes = Modes(
        np.array([1.5, 2.5]),
        np.array([0.01, np.nan]),
        np.array([[1, 1j], [0.5 - 0.25j, -1]]),
        OUTPUTS,
        frequency_std=np.array([0.1, np.inf]),
    )
    system = StateSpace(
        np.eye(4) / 2, np.zeros((4, 0)), np.zeros((2, 4)), np.zeros((2, 0)), 0.02, (), OUTPUTS
    )
    found = Realization("ssi_cov", (system,), np.array([2.0, 1.0]), 4, {"n_block_rows": 20})
    matrices = SecondOrder(
        np.diag([1.0, 2.0]), np.zeros((2, 2)), np.eye(2), ("x1", "x2"), mass_std=np.ones((2, 2))
    )
    fields = {
        "title": "Zwei Massen, gekoppelt über k₁₂",
        "sample_rate": 50.0,
        "modes": modes,
        "stable": (np.True_, False),
        "second_order": matrices,
        "realization": found,
        "stabilization": None,
        "warnings": ("short record",),
    }
    return Result(**(fields | changes))


def test_says_what_the_contract_lists(tmp_path):
    save_result(result(), tmp_path / "result.json")
    document = load_result(tmp_path / "result.json")
    assert document["format"] == "modal-result"
    assert document["version"] == 1
    assert (document["method"], document["order"], document["sample_rate"]) == ("ssi_cov", 4, 50.0)
    assert document["title"] == "Zwei Massen, gekoppelt über k₁₂"
    assert document["modes"] == [
        {
            "frequency_hz": 1.5,
            "frequency_std": 0.1,
            "damping_ratio": 0.01,
            "damping_std": None,
            "shape": {"acc1.x": [1.0, 0.0], "acc2.x": [0.5, -0.25]},
            "stable": True,
        },
        {
            "frequency_hz": 2.5,
            "frequency_std": None,
            "damping_ratio": None,
            "damping_std": None,
            "shape": {"acc1.x": [0.0, 1.0], "acc2.x": [-1.0, 0.0]},
            "stable": False,
        },
    ]
    assert document["second_order"] == {
        "dofs": ["x1", "x2"],
        "mass": [[1.0, 0.0], [0.0, 2.0]],
        "damping": [[0.0, 0.0], [0.0, 0.0]],
        "stiffness": [[1.0, 0.0], [0.0, 1.0]],
        "mass_std": [[1.0, 1.0], [1.0, 1.0]],
        "damping_std": None,
        "stiffness_std": None,
    }
    assert document["truth"] is None
    assert document["comparison"] is None
    assert document["warnings"] == ["short record"]


def test_truth_and_comparison(tmp_path):
    mine = result()
    truth = Modes(np.array([2.0, 2.5]), np.array([0.01, 0.02]), mine.modes.shapes, OUTPUTS)
    heavier = SecondOrder(2 * mine.second_order.mass, np.eye(2), np.eye(2), ("x1", "x2"))
    with_truth = result(
        truth_modes=truth,
        truth_second_order=heavier,
        comparison=compare(truth, mine.modes, heavier, mine.second_order, frequency_band=0.3),
        criteria=(Criterion("mass_error", 1e-3, 0.5, False), Criterion("mac", 0.9, None, False)),
    )
    save_result(with_truth, tmp_path / "result.json")
    document = load_result(tmp_path / "result.json")
    assert [mode["frequency_hz"] for mode in document["truth"]["modes"]] == [2.0, 2.5]
    assert document["truth"]["second_order"]["mass"] == [[2.0, 0.0], [0.0, 4.0]]
    first, second = document["comparison"]["pairs"]
    assert (first["truth"], first["estimate"], first["frequency_error"]) == (0, 0, -0.25)
    # |aᴴa|² over itself: two roundings.
    assert first["mac"] == pytest.approx(1.0, abs=1e-15)
    assert second["damping_error"] is None
    assert document["comparison"]["mass_error"] == 0.5
    assert document["criteria"][0] == {"name": "mass_error", "limit": 1e-3, "value": 0.5, "passed": False}


def test_is_strict_json(tmp_path):
    save_result(result(), tmp_path / "result.json")

    def refuse(constant):
        raise AssertionError(constant)

    json.loads((tmp_path / "result.json").read_text("utf-8"), parse_constant=refuse)


def test_other_files_are_refused(tmp_path):
    for name, text, says in (
        ("broken.json", "{", "is not JSON"),
        ("list.json", "[]", "expected 'modal-result'"),
        ("later.json", '{"format": "modal-result", "version": 2}', "version 1"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(FileError, match=says):
            load_result(tmp_path / name)
    with pytest.raises(FileError, match="No such file"):
        load_result(tmp_path / "absent.json")


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(FileError, match="cannot be written"):
        save_result(result(), tmp_path / "absent/result.json")
