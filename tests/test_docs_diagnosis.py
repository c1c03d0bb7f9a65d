"""The tutorial on diagnosis is true: its commands and its Python run and come to what it says."""

import re
from pathlib import Path

import pytest

from lab.files.diagnosis import load_diagnosis
from tests.tutorial import blocks, run

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "docs/diagnosis.md").read_text("utf-8")


@pytest.mark.slow
def test_the_commands_come_to_what_the_text_says(tmp_path, monkeypatch, capsys):
    for name in ("scenarios", "models"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    commands = [line for block in blocks(TEXT, "sh") for line in block.splitlines()]
    view = [command for command in commands if command.startswith("lab view")]
    assert view == ["lab view out/found"]  # opens a window, so it is not run here
    for command in commands:
        if command not in view:
            run(command)
    found = load_diagnosis("out/found/diagnosis.json")
    assert found["verdict"] == "explained"
    assert [(f["cause"], f["location"]) for f in found["findings"]] == [("cubic_stiffness", "spring2_3")]
    assert load_diagnosis("out/again/diagnosis.json")["verdict"] == "consistent"
    page = Path("out/found/report.html").read_text("utf-8")
    for told in ("restoring-force", "What these data cannot tell"):
        assert told in page
    for name in re.findall(r"^- `(\w+\.\w+)`", TEXT, re.MULTILINE):
        assert (tmp_path / "out/found" / name).is_file()
    capsys.readouterr()
    (code,) = blocks(TEXT, "python")
    exec(code, {})
    said = capsys.readouterr().out
    assert said.startswith("explained\nCubic stiffness at spring2_3")


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", TEXT):
        assert (ROOT / "docs" / target).exists(), target
