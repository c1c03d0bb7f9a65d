"""Placement files: read strictly, the same as the options of the command, which win where both speak."""

from pathlib import Path

import click
import pytest

from lab import catalogue
from lab.cli import main
from lab.cli.place import command
from lab.errors import FileError, StudyError
from lab.files.placement import load_placement
from lab.placement.file import NAMES, PlacementFile, load_placement_file
from tests.lab.placement.structures import row_of_masses

TEXT = """
title = "A row of masses"
model = "row.xml"
sensors = 2
noise = { "m/s^2" = 0.01 }
fixed = ["a1.x"]
"""
EXAMPLES = sorted((catalogue.folder("scenarios") / "placements").glob("*.toml"))


def written(folder, text=TEXT):
    (folder / "row.xml").write_text(row_of_masses(3).xml)
    (folder / "row.toml").write_text(text)
    return folder / "row.toml"


def placed(*words):
    with pytest.raises(SystemExit) as ended:
        main(["place", *map(str, words)])
    return ended.value.code


def test_every_key_is_an_option_of_the_command():
    options = {each.name for each in command.params if isinstance(each, click.Option)}
    keys = {NAMES.get(key, key) for key in PlacementFile.model_fields} - {"title"}
    # What concerns the output is asked on the command line alone.
    assert keys == options - {"out", "force", "as_json", "quiet"}


def test_a_file_is_the_same_as_its_options(tmp_path, monkeypatch):
    path = written(tmp_path)
    monkeypatch.chdir(tmp_path)
    words = ("--model", "row.xml", "--sensors", 2, "--noise", "m/s^2=0.01", "--fixed", "a1.x")
    assert placed(*words, "--out", "typed", "--quiet") == 0
    monkeypatch.chdir("/")
    assert placed(path, "--out", tmp_path / "filed", "--quiet") == 0
    documents = [load_placement(tmp_path / name / "placement.json") for name in ("typed", "filed")]
    assert documents[0] == documents[1]


def test_options_beside_a_file_win(tmp_path):
    assert placed(written(tmp_path), "--sensors", 3, "--out", tmp_path / "out", "--quiet") == 0
    assert len(load_placement(tmp_path / "out/placement.json")["sensors"]) == 3


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (TEXT.replace("sensors", "sensros"), "unknown key 'sensros' at the top; allowed are title, scenario"),
        (TEXT.replace("sensors = 2", ""), "key 'sensors' is missing"),
        (TEXT.replace("0.01", "-1.0"), "greater than 0"),
        ("title = ", "is not TOML"),
    ],
)
def test_mistakes_are_told(tmp_path, capsys, text, complaint):
    path = written(tmp_path, text)
    with pytest.raises(StudyError) as caught:
        load_placement_file(path)
    assert complaint in str(caught.value)
    assert placed(path, "--out", tmp_path / "out") == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(FileError, match="expected a placement file"):
        load_placement_file(tmp_path / "none.toml")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_are_whole_and_their_scenarios_exist(path):
    asked = load_placement_file(path)
    name = asked.get("scenario") or asked["model"]
    assert Path(name).is_file() or catalogue.find("scenarios" if "scenario" in asked else "models", name)
