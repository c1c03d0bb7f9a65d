"""The command line: what it prints and writes, and one helpful line with status 2 for every mistake."""

import json
import os
import re
import shlex
import subprocess
import sys
import threading
from pathlib import Path

import click
import h5py
import numpy as np
import pytest

from identification.recording import Record
from lab.cli import cli, main
from lab.cli.colour import coloured
from lab.cli.progress import CLEAR, SHOW_CURSOR, Bar
from lab.files.recording import load, save

ROOT = Path(__file__).parents[2]
SMALL = """
title = "Two swings"
model = "chain3_uncoupled.xml"

[test]
sample_rate = 20.0
duration = 5.0
accuracy = 1e-6

[excitation]
kind = "pulse"

[channels]
inputs = ["force1", "force2"]
outputs = ["acc2.x", "acc3.x"]

[identification]
method = "era"
order = 6
"""

OUTPUTS = ["recording.h5", "report.html", "result.json", "run.rrd"]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The output folder of one small test."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "small.toml").write_text(SMALL)
    assert status("run", folder / "small.toml", "--out", folder / "out", "--quiet") == 0
    return folder / "out"


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """An empty working folder that holds nothing but a scenario."""
    (tmp_path / "small.toml").write_text(SMALL)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def status(*arguments):
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return ended.value.code


def complaint(capsys, *arguments):
    """The one line on standard error of a call that must fail with status 2."""
    assert status(*arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("lab: ")
    assert printed.err.count("\n") == 1
    assert "Traceback" not in printed.err
    return printed.err


def test_run_writes_everything_and_tells_the_matrices(finished, capsys, bench):
    assert sorted(os.listdir(finished)) == OUTPUTS
    assert status("run", "small.toml", "--out", "again") == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert len(printed.out.splitlines()) < 40
    assert re.search(r"M \[kg\] +largest error / largest entry \d\.\de-\d\d", printed.out)
    assert "3 of 3 true modes found" in printed.out
    assert sorted(os.listdir(bench)) == ["again", "small.toml"]


def test_the_same_seed_gives_the_same_files(finished, bench):
    assert status("run", "small.toml", "--out", "again", "--quiet") == 0
    for name in ("recording.h5", "result.json"):
        assert (bench / "again" / name).read_bytes() == (finished / name).read_bytes()


def test_json_is_the_result_and_nothing_else(finished, bench, capsys):
    assert status("run", "small.toml", "--out", "again", "--json") == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out) == json.loads((finished / "result.json").read_text("utf-8"))
    assert printed.err == ""


def test_quiet_says_nothing(bench, capsys):
    assert status("run", "small.toml", "--out", "again", "--quiet") == 0
    assert capsys.readouterr().out == ""


def test_a_terminal_sees_progress(bench, capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert status("run", "small.toml", "--out", "again", "--json") == 0
    printed = capsys.readouterr()
    for what in ("simulating", "identifying", "finding error bars", "writing the report"):
        assert what in printed.err
    assert "100%" in printed.err
    assert printed.err.endswith(CLEAR + SHOW_CURSOR)
    json.loads(printed.out)
    assert status("run", "small.toml", "--out", "third", "--quiet") == 0
    assert capsys.readouterr().err == ""


def test_identify_finds_the_same_modes(finished, bench, capsys):
    for extra in ([], ["--method", "era"], ["--method", "era", "--order", "6"]):
        arguments = ["identify", finished / "recording.h5", *extra, "--out", "again", "--force", "--json"]
        assert status(*arguments) == 0
        found = json.loads(capsys.readouterr().out)
        truth = json.loads((finished / "result.json").read_text("utf-8"))["truth"]["modes"]
        # The simulation is accurate to 1e-6; frequencies are at least as good as the response.
        expected = [mode["frequency_hz"] for mode in truth]
        assert [mode["frequency_hz"] for mode in found["modes"]] == pytest.approx(expected, rel=1e-5)
        assert found["truth"] is None
        assert sorted(os.listdir("again")) == OUTPUTS[1:]


def test_seed_method_and_order_replace_the_scenario(bench, capsys):
    arguments = ("run", "small.toml", "--out", "again", "--order", "4", "--seed", "9", "--json")
    assert status(*arguments) == 0
    assert json.loads(capsys.readouterr().out)["order"] == 4


def test_output_names_itself_after_the_scenario(bench):
    assert status("run", "small.toml", "--quiet") == 0
    assert sorted(os.listdir("out/small")) == OUTPUTS


def test_existing_output_is_kept_without_force(bench, capsys):
    (bench / "mine").mkdir()
    (bench / "mine/result.json").write_text("precious")
    assert "add --force" in complaint(capsys, "run", "small.toml", "--out", "mine")
    assert os.listdir("mine") == ["result.json"]
    assert (bench / "mine/result.json").read_text() == "precious"
    assert status("run", "small.toml", "--out", "mine", "--force", "--quiet") == 0
    assert sorted(os.listdir("mine")) == OUTPUTS


def edit(old, new):
    def change():
        assert old in SMALL
        Path("small.toml").write_text(SMALL.replace(old, new, 1))

    return change


def broken_model():
    Path("chain3_uncoupled.xml").write_text("<mujoco><worldbody><body></worldbody></mujoco>")


def refused_model():
    Path("chain3_uncoupled.xml").write_text(
        "<mujoco><worldbody><body><joint type='slide' name='x'/></body></worldbody></mujoco>"
    )


def remove():
    Path("small.toml").unlink()


@pytest.mark.parametrize(
    ("mistake", "says"),
    [
        (remove, "small.toml"),
        (edit("[test]", "[test"), "is not TOML"),
        (edit("sample_rate", "samplerate"), "unknown key 'samplerate' in [test]; allowed are sample_rate"),
        (edit("chain3_uncoupled.xml", "chain9.xml"), "chain3_uncoupled"),
        (edit("acc3.x", "acc9.x"), "'acc9.x' does not exist in the model; there are acc1.x"),
        (edit("force2", "force9"), "'force9' does not exist in the model; there are force1"),
        (edit('"era"', '"magic"'), "okid_era"),
        (edit("order = 6", 'order = 6\nsettings = { colour = "red" }'), "colour"),
        (edit("duration = 5.0", "duration = 1e-9"), "0 samples"),
        (
            edit('kind = "pulse"', 'kind = "ambient"\ndofs = ["x9"]'),
            "'x9' does not exist; there are x1, x2, x3",
        ),
        (edit("[identification]", '[instruments]\naccelerometer = "best"\n[identification]'), "'best'"),
        (broken_model, "chain3_uncoupled.xml"),
        (refused_model, "chain3_uncoupled.xml"),
    ],
    ids=lambda value: getattr(value, "__name__", str(value))[:40],
)
def test_a_mistake_in_a_scenario_is_one_line_and_leaves_nothing(bench, capsys, mistake, says):
    mistake()
    before = sorted(os.listdir(bench))
    assert says in complaint(capsys, "run", "small.toml", "--out", "deep/out")
    assert sorted(os.listdir(bench)) == before


def truncated(path):
    path.write_bytes(path.read_bytes()[:-500])


def with_a_gap(path):
    recording = load(path)
    first = recording.records[0]
    outputs = np.array(first.outputs)
    outputs[1, 30] = np.nan
    holed = Record(first.kind, first.inputs, outputs)
    save(type(recording)((holed,), recording.inputs, recording.outputs, recording.sample_rate), path)


def without_outputs(path):
    with h5py.File(path, "r+") as file:
        del file["records/1/outputs"]


def as_text(path):
    path.write_text("time, acceleration\n0.0, 1.0\n")


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (truncated, "truncated file"),
        (with_a_gap, "'acc3.x' of record 0 misses a sample at t = 1.5 s"),
        (without_outputs, "has no dataset 'outputs'"),
        (as_text, "not an HDF5 file"),
        (Path.unlink, "no such file"),
    ],
)
def test_a_damaged_recording_is_one_line_and_leaves_nothing(finished, bench, capsys, damage, says):
    path = bench / "test.h5"
    path.write_bytes((finished / "recording.h5").read_bytes())
    damage(path)
    before = sorted(os.listdir(bench))
    assert says in complaint(capsys, "identify", "test.h5", "--out", "out")
    assert sorted(os.listdir(bench)) == before


def test_unknown_methods_and_orders(finished, bench, capsys):
    recording = finished / "recording.h5"
    assert "okid_era" in complaint(capsys, "identify", recording, "--method", "magic", "--out", "out")
    asked = ("identify", recording, "--method", "era", "--order", "999", "--out", "out")
    assert "order 999" in complaint(capsys, *asked)
    assert os.listdir(bench) == ["small.toml"]


def test_a_place_that_cannot_be_written(bench, capsys):
    (bench / "file").write_text("mine")
    for place in ("file", "file/below", "/proc/nowhere/out"):
        assert "--out" in complaint(capsys, "run", "small.toml", "--out", place)
    assert sorted(os.listdir(bench)) == ["file", "small.toml"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["fly"], "No such command 'fly'"),
        (["run"], "Missing argument 'SCENARIO.toml'"),
        (["run", "small.toml", "--speed", "3"], "No such option '--speed'"),
        (["run", "small.toml", "--seed", "x"], "'x' is not a valid integer"),
        (["run", "small.toml", "--order", "0"], "0 is not in the range"),
        (["list", "sensors"], "'sensors' is not one of 'models'"),
    ],
)
def test_bad_usage_is_one_line(bench, capsys, arguments, says):
    line = complaint(capsys, *arguments)
    assert says in line
    assert "--help" in line


def test_a_fault_of_the_lab_is_not_dressed_up(bench, monkeypatch):
    def buggy(*arguments, **options):
        raise ZeroDivisionError

    monkeypatch.setattr("lab.scenario.load_scenario", buggy)
    with pytest.raises(ZeroDivisionError):
        main(["run", "small.toml"])


def test_list(capsys):
    assert status("list") == 0
    printed = capsys.readouterr().out
    for name in ("models:", "chain7", "scenarios:", "truss_random", "methods:", "ssi_cov", "effects:"):
        assert name in printed
    assert re.search(r"^  truss +De Angelis", printed, re.MULTILINE)
    assert status("list", "methods", "--json") == 0
    assert "era" in json.loads(capsys.readouterr().out)["methods"]


def test_view_tells_what_to_do_without_a_display(finished, bench, capsys, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert "rerun run.rrd" in complaint(capsys, "view", finished)
    assert "expected a folder that" in complaint(capsys, "view", "nowhere")


def test_view_opens_the_viewer(finished, monkeypatch):
    called = []

    class Done:
        returncode = 0

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("subprocess.run", lambda command, check: called.append(command) or Done())
    assert status("view", finished) == 0
    assert status("view", finished / "run.rrd") == 0
    assert called == 2 * [[sys.executable, "-m", "rerun", str(finished / "run.rrd")]]


def test_a_bar_tells_the_time_left(capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    now = 0.0
    monkeypatch.setattr("lab.cli.progress.time.monotonic", lambda: now)
    with Bar(quiet=False) as bar:
        monkeypatch.setattr(bar, "clock", threading.current_thread())  # no thread draws between
        bar("calibrating", 0.0)
        now = 30.0
        bar("searching", 0.25)
        assert "25%" in (seen := capsys.readouterr().err)
        assert "1:30 left" in seen
        # More work than was known of: a new bar, at a pace of its own.
        now = 40.0
        bar("searching again", 0.1)
        assert "  0%" in (seen := capsys.readouterr().err)
        assert "left" not in seen
        now = 50.0
        bar("searching again", 0.55)
        assert "50%  0:10 left" in capsys.readouterr().err
        bar.clock = None
    assert capsys.readouterr().err == CLEAR + SHOW_CURSOR
    with Bar(quiet=True) as bar:
        bar("placing", 0.5)
    assert capsys.readouterr().err == ""


def test_colours_are_for_terminals_that_want_them(monkeypatch, bench):
    """A command on a terminal of its own, as far as this system has such."""
    pty = pytest.importorskip("pty")

    def seen(**environment):
        ours, theirs = pty.openpty()
        subprocess.run(
            [sys.executable, "-m", "lab", "fly"],
            stderr=theirs,
            env={**os.environ, **environment, "PYTHONPATH": str(ROOT)},
            check=False,
        )
        os.close(theirs)
        try:
            return os.read(ours, 1000).decode()
        finally:
            os.close(ours)

    monkeypatch.delenv("NO_COLOR", raising=False)
    assert seen().startswith("\x1b[31m\x1b[1mlab:\x1b[0m No such command")
    assert seen(NO_COLOR="1").startswith("lab: No such command")


def test_colours_mark_the_beginning_of_lines():
    painted = coloured("Explained: so\n  met    modes\n  MISSED mac\nnothing met  \nwarning: short")
    assert (
        click.unstyle(painted) == "Explained: so\n  met    modes\n  MISSED mac\nnothing met  \nwarning: short"
    )
    assert [line.startswith("\x1b") for line in painted.split("\n")] == [True, True, True, False, True]


COMPLETED = (
    ("lab dia", ["plain,diagnose"]),
    ("lab run chain3_p", ["plain,chain3_pulse"]),
    ("lab run ./sc", ["file,./sc"]),
    ("lab diagnose test.h5 --effects freeplay,cubic", ["plain,freeplay,cubic_stiffness"]),
    ("lab identify --method ssi_d", ["plain,ssi_data"]),
    ("lab place --model trus", ["plain,truss", "plain,truss_spatial"]),
    ("lab list eff", ["plain,effects"]),
    ("lab study --se", ["plain,--seed"]),
)


@pytest.mark.parametrize(("words", "offered"), COMPLETED, ids=[words for words, _ in COMPLETED])
def test_the_shell_completes(monkeypatch, capsys, words, offered):
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    monkeypatch.setenv("_LAB_COMPLETE", "bash_complete")
    assert status() == 0
    assert capsys.readouterr().out.split() == offered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_for_completion(monkeypatch, capsys, shell):
    # bash is asked for its version, which not every machine can tell.
    monkeypatch.setattr("click.shell_completion.BashComplete._check_version", staticmethod(lambda: None))
    monkeypatch.setenv("_LAB_COMPLETE", f"{shell}_source")
    assert status() == 0
    assert f"_LAB_COMPLETE={shell}_complete" in capsys.readouterr().out


OPTIONS = {
    "run": "--seed --method --order --out --force --json --quiet",
    "view": "",
    "import": "--out --force --json --quiet",
    "check": "--model --map --json --quiet",
    "identify": "--method --order --model --map --out --force --json --quiet",
    "diagnose": "--model --map --effects --widths --out --force --json --quiet",
    "place": "--model --effects --seed --out --force --json --quiet",
    "study": "--seed --out --force --json --quiet",
    "export": "--model --out --force --json --quiet",
    "list": "--json",
}
"""The options that commands share."""


@pytest.mark.parametrize("name", cli.commands)
def test_shared_options_are_the_same_everywhere(name):
    shared = {option for options in OPTIONS.values() for option in options.split()}
    params = {
        option: param for param in cli.commands[name].params for option in param.opts if option in shared
    }
    assert set(params) == set(OPTIONS[name].split())
    for option, param in params.items():
        assert param.is_flag == (option in ("--force", "--json", "--quiet")), option
        assert param.help[-1] in ".]", option


@pytest.mark.parametrize("name", cli.commands)
def test_every_help_has_an_example(capsys, name):
    assert status(name, "--help") == 0
    printed = capsys.readouterr().out
    # On one line, so that it can be copied.
    (line,) = re.findall(rf"^  Example: (lab {name} .*)$", printed, re.MULTILINE)
    _, *words = shlex.split(line)
    cli.commands[name].make_context(name, words[1:])


def test_help_answers_at_once():
    resource = pytest.importorskip("resource")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-m", "lab", "--help"], check=True, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert "Example: lab run" in done.stdout
    assert (after.ru_utime - before.ru_utime) + (after.ru_stime - before.ru_stime) < 0.5
