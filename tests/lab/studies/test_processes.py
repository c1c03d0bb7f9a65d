"""Processes of this machine: the same results for any number, and no way to die loses or repeats a run."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time

import pytest

import lab
from tests.lab.studies.small import STUDY, conducted, rows, written

pytestmark = pytest.mark.slow
MANY = STUDY.replace("repeats = 3", "repeats = 12")


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A study of 48 runs, and what one process makes of it."""
    folder = tmp_path_factory.mktemp("alone")
    path = written(folder, MANY)
    conducted(path, folder / "out")
    return path, rows(folder / "out")


def test_killed_without_warning_it_goes_on_with_nothing_lost_or_repeated(alone, tmp_path):
    path, expected = alone
    out, book = tmp_path / "out", tmp_path / "out/study.jsonl"
    typed = ["study", str(path), "--out", str(out), "--workers", "2"]
    process = subprocess.Popen([sys.executable, "-m", "lab", *typed], stdout=subprocess.DEVNULL)
    # A header, and some runs.
    waited(lambda: book.is_file() and book.read_bytes().count(b"\n") > 8)
    process.send_signal(signal.SIGKILL)
    process.wait()
    survived = book.read_bytes()
    survived = survived[: survived.rindex(b"\n") + 1]
    assert 8 < survived.count(b"\n") <= 48
    assert not (out / "study.h5").exists()
    conducted(path, out)
    # Those that were there still are, each run is there once, and all are what one process makes of them.
    assert book.read_bytes().startswith(survived)
    assert book.read_bytes().count(b"\n") == 49
    assert rows(out) == expected
    assert (out / "study.h5").exists()


def test_a_killed_worker_costs_nothing(alone, tmp_path):
    path, expected = alone
    killed = []

    def kill(n, *, total):
        if not killed:
            victim = multiprocessing.active_children()[0]
            killed.append(victim)
            os.kill(victim.pid, signal.SIGKILL)

    lab.study(path, tmp_path / "out", workers=1, progress=kill)
    assert len(killed) == 1
    assert rows(tmp_path / "out") == expected


def test_stopped_by_the_user_nothing_stays_behind(alone, tmp_path):
    path, _ = alone

    def stop(n, *, total):
        raise KeyboardInterrupt

    before = os.environ.get("OMP_NUM_THREADS")
    with pytest.raises(KeyboardInterrupt):
        lab.study(path, tmp_path / "out", workers=1, progress=stop)
    assert multiprocessing.active_children() == []
    assert os.environ.get("OMP_NUM_THREADS") == before
    assert 0 < len(rows(tmp_path / "out")) < 48


def waited(for_what):
    end = time.monotonic() + 60
    while not for_what():
        assert time.monotonic() < end
        time.sleep(0.01)
