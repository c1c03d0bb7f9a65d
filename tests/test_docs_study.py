"""The tutorial on studies is true: its commands and its Python run, and its examples are those that exist."""

import re
import shutil
import tomllib
from pathlib import Path

import pytest

from lab import catalogue
from lab.studies.plan import load_study
from tests.tutorial import blocks, run

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "docs/study.md").read_text("utf-8")


@pytest.mark.slow
def test_the_commands_run_and_write_what_the_text_says(tmp_path, monkeypatch, capsys):
    shutil.copytree(ROOT / "scenarios/studies", tmp_path / "scenarios/studies")
    # Fewer values and repeats, so that it takes seconds.
    study = tmp_path / "scenarios/studies/noise.toml"
    text = study.read_text("utf-8")
    study.write_text(
        text.replace("repeats = 20", "repeats = 1").replace("count = 5", "count = 2"), encoding="utf-8"
    )
    monkeypatch.chdir(tmp_path)
    (command,) = [line for block in blocks(TEXT, "sh") for line in block.splitlines()]
    run(command)
    assert "4 runs: 4 points, 1 repeat\n" in capsys.readouterr().out
    for name in re.findall(r"^- `(\w+\.\w+)`", TEXT, re.MULTILINE):
        assert (tmp_path / "out/noise" / name).is_file()
    (code,) = blocks(TEXT, "python")
    exec(code, {"__name__": "__main__"})
    assert "0.5 % noise, era: " in capsys.readouterr().out


def test_the_study_file_shown_is_a_study(tmp_path):
    (text,) = blocks(TEXT, "toml")
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    assert load_study(path).n_runs == 7 * 2 * tomllib.loads(text)["repeats"]


def test_the_table_lists_every_example():
    listed = set(re.findall(r"^\| `(\w+)` \|", TEXT, re.MULTILINE))
    assert listed == {path.stem for path in (catalogue.folder("scenarios") / "studies").glob("*.toml")}
