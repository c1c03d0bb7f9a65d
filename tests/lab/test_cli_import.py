"""`lab import` and `lab export`: what they print and write, and one line with status 2 for every mistake."""

import json

import numpy as np
import pytest

from lab.cli import main
from lab.files.recording import load
from tests.lab import universal

TIME = np.arange(64) / 128.0
SIGNAL = np.sin(7 * TIME)


@pytest.fixture(autouse=True)
def bench(tmp_path, monkeypatch):
    """A working folder with one universal file and one table."""
    force = universal.function(np.cos(TIME), TIME, type=13, label="N", binary="<")
    (tmp_path / "test.uff").write_bytes(force + universal.function(SIGNAL, TIME, label="g", binary="<"))
    np.savetxt(tmp_path / "test.csv", np.column_stack([TIME, SIGNAL]), delimiter=",")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def status(*arguments):
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return ended.value.code


def complaint(capsys, *arguments, printed=""):
    assert status(*arguments) == 2
    said = capsys.readouterr()
    assert said.err.startswith("lab: ")
    assert said.err.count("\n") == 1
    assert said.out == printed or printed is None
    return said


def test_a_universal_file_needs_no_recipe(capsys):
    assert status("import", "test.uff") == 0
    said = capsys.readouterr()
    assert "force 1+Z [N]" in said.out
    assert "written: test.h5" in said.out
    np.testing.assert_array_equal(load("test.h5").records[0].outputs[0], SIGNAL * 9.80665)


def test_json_is_all_that_is_printed(capsys):
    assert status("import", "test.uff", "--out", "a.h5", "--kind", "impact", "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["outputs"] == {"acceleration 1+Z": "m/s^2"}
    assert (document["records"], document["samples"], document["sample_rate"]) == (1, 64, 128.0)
    assert load("a.h5").records[0].kind == "impact"


def test_an_ambiguous_table_prints_its_lines_and_a_recipe(capsys, bench):
    said = complaint(capsys, "import", "test.csv", printed=None)
    assert (bench / "test.csv").read_text().splitlines()[1] in said.out
    (bench / "r.toml").write_text(said.out.replace('"?"', "1.0", 1).replace('"?"', '"m"'))
    assert status("import", "test.csv", "--recipe", "r.toml", "--quiet") == 0
    assert load("test.h5").sample_rate == 1.0


def test_the_recipe_goes_to_a_file_on_request(capsys, bench):
    said = complaint(capsys, "import", "test.csv", "--write-recipe", "r.toml")
    assert "r.toml" in said.err
    assert "[[outputs]]" in (bench / "r.toml").read_text()
    assert "exists already" in complaint(capsys, "import", "test.csv", "--write-recipe", "r.toml").err
    assert "[[outputs]]" not in complaint(capsys, "import", "test.csv", "--json").err


def test_files_are_replaced_on_request_only(capsys, bench):
    (bench / "test.h5").write_text("precious")
    assert "exists already" in complaint(capsys, "import", "test.uff").err
    assert (bench / "test.h5").read_text() == "precious"
    assert status("import", "test.uff", "--force", "--quiet") == 0
    (bench / "data.csv").write_text("precious")
    assert "exists already" in complaint(capsys, "export", "test.h5", "--to", "data.csv").err
    assert status("export", "test.h5", "--to", "data.csv", "--force") == 0
    assert (bench / "data.csv").read_text().startswith("time [s],")


def test_a_universal_file_goes_in_and_out_and_in_again(bench):
    assert status("import", "test.uff", "--quiet") == 0
    assert status("export", "test.h5", "--to", "again.uff", "--json") == 0
    assert status("import", "again.uff", "--quiet") == 0
    np.testing.assert_array_equal(
        load("again.h5").records[0].outputs[0], load("test.h5").records[0].outputs[0]
    )


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["import", "missing.uff"], "no such file"),
        (["import", "."], "is a folder"),
        (["import", "test.uff", "--recipe", "missing.toml"], "cannot be read"),
        (["import", "test.uff", "--recipe", "test.csv"], "is not TOML"),
        (["import", "test.uff", "--kind", "loud"], "loud"),
        (["import", "test.uff", "--out", "a.json"], "only modes go into .json"),
        (["import", "test.uff", "--out", "none/a.h5"], "cannot be written"),
        (["export", "missing", "--to", "a.csv"], "no such file"),
        (["export", ".", "--to", "a.csv"], "nothing to export"),
        (["export", "test.csv", "--to", "a.csv"], "not an HDF5 file"),
        (["export", "test.csv", "--to", "a.doc"], "expected .uff"),
        (["export", "test.csv"], "--to"),
    ],
)
def test_a_mistake_is_one_line(capsys, bench, arguments, says):
    printed = None if arguments == ["import", "."] else ""
    assert says in complaint(capsys, *arguments, printed=printed).err
    assert sorted(path.name for path in bench.iterdir()) == ["test.csv", "test.uff"]
