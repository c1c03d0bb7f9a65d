"""`lab check` on the command line: one screen, JSON, exit status."""

import json

import numpy as np
import pytest

from lab.cli import main
from lab.files.recording import save
from tests.lab.checks.benches import SPOIL, clean, spoilt
from tests.lab.checks.rigs import measured, swapped


def status(*arguments):
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return ended.value.code


@pytest.fixture
def spiky(tmp_path):
    save(spoilt(clean("random", 1), 2, SPOIL["spikes"](np.random.default_rng(0))), tmp_path / "spiky.h5")
    return tmp_path / "spiky.h5"


def test_a_screen_of_remarks(spiky, capsys):
    assert status("check", spiky) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "3 spikes" in printed.out
    assert "Advice: " in printed.out
    assert all(len(line) <= 110 for line in printed.out.splitlines())


def test_remarks_as_data(spiky, capsys):
    assert status("check", spiky, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["format"], document["version"]) == ("modal-check", 1)
    (remark,) = document["remarks"]
    assert (remark["check"], remark["channel"], remark["severity"]) == ("spikes", "acc3", "doubt")
    assert remark["evidence"]["spikes"] == 3
    assert 0 < remark["start"] < remark["stop"]


def test_nothing_to_remark(tmp_path, capsys):
    save(clean("random", 1), tmp_path / "clean.h5")
    assert status("check", tmp_path / "clean.h5") == 0
    assert "nothing to remark" in capsys.readouterr().out


def test_only_faults_when_quiet(spiky, capsys):
    assert status("check", spiky, "--quiet") == 0
    assert capsys.readouterr().out == ""


def test_a_swap_is_found_with_the_model(tmp_path, capsys):
    recording, rig = measured("ambient", 0)
    save(swapped(recording, 0, 2), tmp_path / "swapped.h5")
    rig.save(tmp_path / "model.xml")
    assert status("check", tmp_path / "swapped.h5", "--model", tmp_path / "model.xml") == 0
    assert "order: acc0.x|acc2.x" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", [("nowhere.h5",), ("spiky.h5", "--model", "nowhere.xml")])
def test_bad_input_is_one_line_and_status_2(spiky, capsys, arguments):
    assert status("check", spiky.parent / arguments[0], *arguments[1:]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("lab: ")
    assert printed.err.count("\n") == 1
