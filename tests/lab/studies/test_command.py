"""`lab study` on the command line."""

import json

import pytest

from lab.cli import main
from tests.lab.studies.small import STUDY, conducted, written


def said(capsys, *words):
    with pytest.raises(SystemExit) as ended:
        main(["study", *map(str, words)])
    return ended.value.code, capsys.readouterr()


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """The file and folder of a finished study, so that the command has only to tell of it."""
    folder = tmp_path_factory.mktemp("done")
    path = written(folder, STUDY.replace("repeats = 3", "repeats = 1").replace("[6, 8]", "[6, 60]"))
    conducted(path, folder / "out")
    return path, folder / "out"


def test_a_summary_or_json_or_warnings_alone(done, capsys):
    path, out = done
    code, screen = said(capsys, path, "--out", out)
    assert code == 0
    assert "4 runs, 2 of them failed: 4 points, 1 repeat" in screen.out
    assert screen.out.endswith(f"written: {out}, with study.h5 and report.html\n")
    code, screen = said(capsys, path, "--out", out, "--json")
    assert (code, json.loads(screen.out)["failed"], screen.err) == (0, 2, "")
    code, screen = said(capsys, path, "--out", out, "--quiet")
    assert (code, screen.out) == (0, "")
    assert screen.err.startswith("warning: 2 runs failed: OrderError")


def test_a_mistake_is_one_line_and_status_2(done, capsys, tmp_path):
    path, out = done
    bad = written(tmp_path, STUDY.replace("repeats", "repaets"))
    other = written(tmp_path / "other", STUDY.replace("seed = 7", "seed = 8"))
    for words, told in (
        ((bad, "--out", tmp_path / "x"), "unknown key 'repaets'"),
        ((other, "--out", out), "another seed"),
        ((path, "--out", tmp_path / "x", "--workers", "0"), "--workers"),
        (
            (path, "--out", tmp_path / "x", "--workers", "1", "--scheduler", "tcp://127.0.0.1:1"),
            "either --scheduler",
        ),
        ((tmp_path / "none.toml",), "cannot be read"),
    ):
        code, screen = said(capsys, *words)
        assert (code, screen.out, screen.err.count("\n")) == (2, "", 1)
        assert told in screen.err
    assert not (tmp_path / "x").exists()


def test_another_seed_is_another_study(done, capsys, tmp_path):
    path, out = done
    code, screen = said(capsys, path, "--out", out, "--seed", 7, "--json")  # that of the file
    assert (code, json.loads(screen.out)["failed"]) == (0, 2)
    code, screen = said(capsys, path, "--out", out, "--seed", 8)
    assert (code, screen.err.count("\n")) == (2, 1)
    assert "another seed" in screen.err
    varied = written(tmp_path, STUDY.replace("repeats = 3", "").replace("[vary]", "[vary]\nseed = [1, 2]"))
    code, screen = said(capsys, varied, "--out", tmp_path / "x", "--seed", 8)
    assert (code, screen.err.count("\n")) == (2, 1)
    assert "varies 'seed' itself" in screen.err
    assert not (tmp_path / "x").exists()
