"""One call in a second process: made there when it can be, told of when it cannot, and never left behind."""

import importlib

import numpy as np
import pytest

from lab.aside import Aside
from lab.diagnose_files import present_diagnosis
from tests.lab.diagnosed import explained, recorded, two_masses


@pytest.fixture(autouse=True)
def two_cores(monkeypatch):
    monkeypatch.setattr("lab.aside._cores", lambda: 2)


def test_the_call_is_made_with_what_was_given(tmp_path):
    with Aside("numpy", "save") as aside:
        assert aside.begin(tmp_path / "a.npy", np.arange(5), allow_pickle=False)
        assert aside.done()
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), np.arange(5))


@pytest.mark.parametrize(
    ("module", "function"), [("absent_module", "f"), ("os", "absent_function"), ("os", "rmdir")]
)
def test_a_call_that_fails_is_told_of(tmp_path, module, function):
    with Aside(module, function) as aside:
        aside.begin(tmp_path / "absent")
        assert not aside.done()


def test_what_cannot_travel_is_not_begun():
    with Aside("os", "rmdir") as aside:
        assert not aside.begin(lambda: None)


@pytest.mark.parametrize("reason", [{"lab.aside._cores": lambda: 1}, {"sys.executable": ""}])
def test_nothing_is_begun_where_a_second_process_makes_no_sense(monkeypatch, reason):
    for name, value in reason.items():
        monkeypatch.setattr(name, value)
    with Aside("os", "rmdir") as aside:
        assert aside.process is None
        assert not aside.begin("absent")
        assert not aside.done()


def test_no_process_is_left_behind():
    with pytest.raises(KeyboardInterrupt), Aside("os", "getcwd") as unasked:
        raise KeyboardInterrupt
    with Aside("time", "sleep") as busy:
        assert busy.begin(3600)
    for aside in (unasked, busy):
        assert aside.process is not None
        assert aside.process.returncode is not None
        assert aside.process.stdin is not None
        assert aside.process.stdin.closed


def test_modules_of_this_process_are_found_by_the_other(tmp_path, monkeypatch):
    (tmp_path / "of_the_user.py").write_text(
        "from pathlib import Path\n\ndef leave(path): Path(path).touch()\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert importlib.import_module("of_the_user")
    with Aside("of_the_user", "leave") as aside:
        assert aside.begin(tmp_path / "mark")
        assert aside.done()
    assert (tmp_path / "mark").exists()


def test_a_report_that_fails_aside_is_written_here(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(
        "lab.diagnose_files._write_report", lambda *page, **told: written.append((page, told))
    )
    monkeypatch.setattr("lab.show.rerun_log.diagnosis.write_diagnosis_rrd", lambda *_, **__: None)
    recording = recorded(two_masses(), n_records=1)
    diagnosis = explained(two_masses(), recording)
    with Aside("os", "absent_function") as aside:
        present_diagnosis(tmp_path, diagnosis, recording, command="lab diagnose …", aside=aside)
    (((*page, _), told),) = written
    assert page == [tmp_path / "report.html", diagnosis]
    assert told["command"] == "lab diagnose …"
