"""From files to a folder, and on the command line; a stand-in answers in place of the search for causes."""

import json
import os
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.catalogue import find
from lab.cli.progress import CLEAR, SHOW_CURSOR
from lab.diagnose_files import diagnose_file
from lab.diagnosis.outcome import Diagnosis
from lab.effects import EFFECTS
from lab.errors import LabError
from lab.files.diagnosis import load_diagnosis
from lab.files.recording import save
from lab.files.recording_responses import save_responses
from lab.matching import renamed, same_channels
from lab.rig import Rig
from tests.lab.diagnosed import explained, recorded, two_masses
from tests.lab.test_cli import complaint, status

OUTPUTS = ["diagnosis.json", "extended.xml", "report.html", "run.rrd"]


class StandIn:
    """Answers like the search for causes, and keeps what it was asked."""

    def __init__(self):
        self.asked = []

    def __call__(
        self, recording: Recording, rig: Rig, *, baseline=None, widths=None, effects=None, progress=None
    ) -> Diagnosis:
        self.asked.append((recording, rig, baseline))
        self.widths, self.effects = widths, effects
        if progress is not None:
            progress("searching for causes", 0.5)
        return explained(rig, recording)


@pytest.fixture
def engine(monkeypatch):
    engine = StandIn()
    monkeypatch.setattr("lab.diagnose_files.diagnose", engine)
    return engine


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """A working folder with a recording and a model of the structure."""
    two_masses().save(tmp_path / "model.xml")
    save(recorded(two_masses(), n_records=1), tmp_path / "test.h5")
    monkeypatch.chdir(tmp_path)
    return tmp_path


ASKED = ("diagnose", "test.h5", "--model", "model.xml")


def test_the_folder_holds_everything(engine, bench):
    diagnosis, recording = diagnose_file("test.h5", "model.xml", "out", command="lab diagnose …")
    assert sorted(os.listdir("out")) == OUTPUTS
    assert load_diagnosis("out/diagnosis.json")["findings"][0]["cause"] == "cubic_stiffness"
    extended = Rig.load("out/extended.xml")
    spring = extended.spring("spring0_1")
    assert extended.model.tendon_stiffnesspoly[spring.index][1] == 5e6
    assert [channel.name for channel in recording.outputs] == ["acc0.x", "pos1"]
    page = Path("out/report.html").read_text("utf-8")
    assert re.search(r"test\.h5, SHA-256 [0-9a-f]{64}", page)
    assert re.search(r"SHA-256 of extended\.xml", page)
    assert diagnosis.verdict == "explained"


def test_the_engine_sees_the_names_of_the_model_and_the_baseline(engine, bench):
    plain = recorded(two_masses(), n_records=1)
    save(renamed(plain, {"pos1": "laser"}), "test.h5")
    # The baseline has its channels in another order.
    turned = renamed(plain.select(outputs=["pos1", "acc0.x"]), {"pos1": "laser"})
    save(turned, "known.h5")
    Path("names.toml").write_text('laser = "pos1"\n')
    diagnose_file("test.h5", "model.xml", "out", baseline="known.h5", mapping="names.toml")
    ((recording, rig, baseline),) = engine.asked
    assert [channel.name for channel in recording.outputs] == ["acc0.x", "pos1"]
    assert [channel.name for channel in rig.outputs] == ["acc0.x", "pos1"]
    assert [channel.name for channel in baseline.outputs] == ["acc0.x", "pos1"]
    np.testing.assert_array_equal(baseline.records[0].outputs, plain.records[0].outputs)


def test_the_command_tells_it_on_one_screen(engine, bench, capsys):
    assert status(*ASKED, "--out", "out") == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert printed.out.startswith("Explained: ")
    assert len(printed.out.splitlines()) < 40
    assert "written: out, with report.html" in printed.out
    assert "lab diagnose test.h5 --model model.xml --out out" in Path("out/report.html").read_text("utf-8")


@pytest.mark.slow
def test_the_report_of_a_long_recording_is_drawn_by_a_helper_and_is_the_same(engine, bench, monkeypatch):
    asked = (*ASKED, "--out", "out", "--quiet", "--force")
    assert status(*asked) == 0
    here = Path("out/report.html").read_bytes()
    monkeypatch.setattr("lab.hands.cores", lambda: 2)
    monkeypatch.setattr(sys.modules["lab.cli.diagnose"], "LONG", 0)
    monkeypatch.setattr("lab.show.diagnosis_report.write_diagnosis_report", None)  # nobody else may draw
    assert status(*asked) == 0
    assert sorted(os.listdir("out")) == OUTPUTS
    assert Path("out/report.html").read_bytes() == here


def test_json_is_the_file_and_nothing_else(engine, bench, capsys):
    assert status(*ASKED, "--out", "out", "--json") == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out) == json.loads(Path("out/diagnosis.json").read_text("utf-8"))
    assert printed.err == ""


def test_widths_and_effects_reach_the_engine(engine, bench, monkeypatch):
    monkeypatch.setattr("lab.diagnose_files.present_diagnosis", lambda *_, **__: None)
    asked = ("--widths", "damping=0.5,mass=0.01", "--widths", "stiffness spring0_1=0.1", "--quiet")
    few = ("--effects", "freeplay, cubic_stiffness", "--effects", "sensor_gain")
    assert status(*ASKED, *asked, *few) == 0
    assert engine.widths == {"damping": 0.5, "mass": 0.01, "stiffness spring0_1": 0.1}
    assert engine.effects == {name: EFFECTS[name] for name in ("freeplay", "cubic_stiffness", "sensor_gain")}
    assert status(*ASKED, "--quiet", "--out", "again") == 0
    assert (engine.widths, engine.effects) == ({}, EFFECTS)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ("--widths", "stiffness spring9=0.1"),
            "'stiffness spring9', which is no parameter of the model; there",
        ),
        (("--widths", "damping"), "--widths is 'damping'; expected NAME=SHARE, such as damping=0.5."),
        (("--widths", "damping=-1"), "expected a positive number"),
        (("--widths", "damping=inf"), "expected a positive number"),
        (("--effects", "rust"), "effect 'rust' does not exist; there are mass_change, "),
    ],
)
def test_widths_and_effects_of_nothing_are_one_line(engine, bench, capsys, words, says):
    assert says in complaint(capsys, *ASKED, *words)
    assert sorted(os.listdir()) == ["model.xml", "test.h5"]


def test_quiet_says_warnings_only(engine, bench, capsys):
    assert status(*ASKED, "--quiet") == 0
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("warning: Too short")
    assert sorted(os.listdir("out/test_diagnosis")) == OUTPUTS


def test_a_terminal_sees_what_is_being_done(engine, bench, capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert status(*ASKED, "--out", "out", "--json") == 0
    printed = capsys.readouterr()
    assert "searching for causes" in printed.err
    assert printed.err.endswith(CLEAR + SHOW_CURSOR)
    json.loads(printed.out)


def test_a_model_by_its_name_in_the_catalogue(engine, bench, capsys):
    line = complaint(capsys, "diagnose", "test.h5", "--model", "chain3_coupled", "--out", "out")
    assert "model 'chain3" in line
    assert "lacks" in line


def rename_channel():
    save(renamed(recorded(two_masses(), n_records=1), {"pos1": "laser"}), "test.h5")


def break_model():
    Path("model.xml").write_text("<mujoco><worldbody>")


def empty_model():
    Path("model.xml").write_text("<mujoco><worldbody/></mujoco>")


def no_recording():
    Path("test.h5").unlink()


def no_model():
    Path("model.xml").unlink()


@pytest.mark.parametrize(
    ("mistake", "extra", "says"),
    [
        (rename_channel, (), "output channel 'laser', which model 'chain' lacks; the model has acc0.x"),
        (break_model, (), "model.xml"),
        (empty_model, (), "nothing can move"),
        (no_recording, (), "no such file"),
        (no_model, (), "there are chain3"),
        (None, ("--baseline", "absent.h5"), "absent.h5: no such file"),
        (None, ("--map", "absent.toml"), "absent.toml: cannot be read"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(engine, bench, capsys, mistake, extra, says):
    if mistake:
        mistake()
    before = sorted(os.listdir(bench))
    assert says in complaint(capsys, *ASKED, *extra, "--out", "deep/out")
    assert sorted(os.listdir(bench)) == before
    assert engine.asked == []


def test_the_model_must_be_named(bench, capsys):
    assert "Missing option '--model'" in complaint(capsys, "diagnose", "test.h5")


def test_existing_output_is_kept_without_force(engine, bench, capsys):
    (bench / "out").mkdir()
    (bench / "out/diagnosis.json").write_text("precious")
    assert "add --force" in complaint(capsys, *ASKED, "--out", "out")
    assert (bench / "out/diagnosis.json").read_text() == "precious"
    assert engine.asked == []
    assert status(*ASKED, "--out", "out", "--force", "--quiet") == 0
    assert sorted(os.listdir("out")) == OUTPUTS


def test_a_picture_that_cannot_be_had_costs_no_diagnosis(engine, bench, monkeypatch):
    def diverging(*arguments, **options):
        raise LabError("the motion is no longer finite")

    monkeypatch.setattr("lab.diagnose_files.motion", diverging)
    diagnose_file("test.h5", "model.xml", "out")
    assert sorted(os.listdir("out")) == OUTPUTS


def test_records_without_inputs_have_no_moving_picture(engine, bench):
    recording = recorded(two_masses(), n_records=1)
    silent = replace(recording.records[0], kind="ambient", inputs=np.zeros((0, 0)))
    save(replace(recording, records=(silent,), inputs=()), "test.h5")
    diagnose_file("test.h5", "model.xml", "out")
    assert sorted(os.listdir("out")) == OUTPUTS


def measured_responses(rig, seed, dt=0.02):
    """Responses to held forces, or as analysers measure them, from the state space, with complex noise of 1 % of their RMS."""
    rng, f = np.random.default_rng(seed), 0.05 * np.arange(1, 401)
    system = rig.state_space().sampled(dt) if dt else rig.state_space()
    turn = 2j * np.pi * f
    z = (np.exp(turn * dt) if dt else turn)[:, None, None] * np.eye(system.A.shape[0])
    B = np.broadcast_to(system.B, (f.size, *system.B.shape))
    H = system.C @ np.linalg.solve(z - system.A, B) + system.D
    level = 0.01 * np.sqrt(np.mean(np.abs(H) ** 2, axis=0) / 2)
    H = H + level * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    return FrequencyResponse(f, H, dt, rig.inputs, rig.outputs)


@pytest.mark.parametrize("dt", [0.02, 0.0])
def test_frequency_responses_are_diagnosed_from_files(tmp_path, monkeypatch, capsys, dt):
    monkeypatch.chdir(tmp_path)
    rig = Rig.load(find("models", "chain7")).connected(
        inputs=["force2"], outputs=["acc2.x", "acc5.x", "acc7.x"]
    )
    heavy = EFFECTS["mass_change"]("mass5", delta_mass=0.1).apply(rig)
    save_responses(renamed(measured_responses(heavy, 1, dt), {"acc7.x": "tip"}), "heavy.h5")
    Path("names.toml").write_text('tip = "acc7.x"\n')
    asked = ("diagnose", "heavy.h5", "--model", "chain7", "--map", "names.toml")
    few = ("--effects", "mass_change,sensor_gain", "--out", "out")
    assert status(*asked, *few) == 0
    assert capsys.readouterr().out.startswith("Explained: ")
    (finding,) = load_diagnosis("out/diagnosis.json")["findings"]
    assert (finding["cause"], finding["location"]) == ("mass_change", "mass5")
    mass = finding["parameters"]["delta_mass"]
    # Four standard deviations: one chance in ten thousand.
    assert abs(mass["value"] - 0.1) < 4 * mass["std"] < 0.05
    page = Path("out/report.html").read_text("utf-8")
    assert "the frequency responses of 3 outputs to 1 input, 400 lines from 0.05 to 20 Hz" in page
    assert sorted(os.listdir("out")) == OUTPUTS
    save(renamed(recorded(two_masses(), n_records=1), {"pos1": "tip"}), "samples.h5")
    assert "holds samples and the recording frequency responses; expected both alike" in complaint(
        capsys, *asked, "--baseline", "samples.h5", "--out", "again"
    )


def test_a_baseline_of_responses_takes_the_channels_of_the_recording():
    rig = Rig.load(find("models", "chain7")).connected(inputs=["force2"], outputs=["acc2.x", "acc5.x"])
    known, turned = (
        measured_responses(rig.connected(inputs=["force2", "force3"], outputs=outputs), 1)
        for outputs in (["acc2.x", "acc5.x"], ["acc5.x", "acc7.x", "acc2.x"])
    )
    turned = replace(turned, coherence=np.abs(turned.values[:, :, 0]), variance=np.abs(turned.values))
    taken = same_channels(turned, replace(known, values=known.values[:, :, 1:], inputs=known.inputs[1:]))
    assert [channel.name for channel in (*taken.inputs, *taken.outputs)] == ["force3", "acc2.x", "acc5.x"]
    np.testing.assert_array_equal(taken.values, turned.values[:, [2, 0], 1:])
    np.testing.assert_array_equal(taken.variance, np.abs(taken.values))
    np.testing.assert_array_equal(taken.coherence, np.abs(turned.values[:, [2, 0], 0]))
