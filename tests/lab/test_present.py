"""What a folder of results says of where it came from."""

import hashlib

from lab.present import present
from lab.scenario import load_scenario
from tests.lab.showcase import chain_result, chain_rig, pulse_recording
from tests.lab.test_show_report import Page


def told(folder):
    return " ".join("".join(Page((folder / "report.html").read_text(encoding="utf-8")).text).split())


def test_the_report_names_the_files_it_rests_on(tmp_path, monkeypatch):
    """By name and checksum: the recording that was given, or the model file of the scenario."""
    monkeypatch.setattr("lab.show.report.draw", lambda *_, **__: [])  # no figure matters here
    rig = chain_rig("chain3_uncoupled", inputs=["force1"], outputs=["acc2.x"])
    source = tmp_path / "measured.h5"
    source.write_bytes(b"samples")
    present(tmp_path, chain_result(rig), pulse_recording(rig), source=source)
    said = told(tmp_path)
    assert f"{source}, SHA-256 {hashlib.sha256(b'samples').hexdigest()}" in said
    assert "Model file" not in said
    scenario = load_scenario("chain3_pulse")
    present(tmp_path, chain_result(rig), pulse_recording(rig), scenario=scenario)
    said = told(tmp_path)
    model = hashlib.sha256(scenario.model_file().read_bytes()).hexdigest()
    assert f"{scenario.model_file()}, SHA-256 {model}" in said
    assert hashlib.sha256(scenario.text.encode()).hexdigest() in said
