"""The tutorial on placement is true: its commands and its Python run and come to what it says."""

import re
from pathlib import Path

import pytest

from lab.files.placement import load_placement
from tests.tutorial import blocks, run

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "docs/placement.md").read_text("utf-8")


@pytest.mark.slow
def test_the_commands_come_to_what_the_text_says(tmp_path, monkeypatch, capsys):
    for name in ("scenarios", "models"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    commands = [line for block in blocks(TEXT, "sh") for line in block.splitlines()]
    view = [command for command in commands if command.startswith("lab view")]
    assert view == ["lab view out/matrices"]  # opens a window, so it is not run here
    for command in commands:
        if command not in view:
            run(command)

    modes = load_placement("out/modes/placement.json")
    assert len(modes["sensors"]) == 8
    assert all("." not in name for name in modes["sensors"])
    assert len(modes["frequency_shifts"]) == 6
    roving = load_placement("out/roving/placement.json")
    assert [len(setup) for setup in roving["setups"]] == [4, 4, 4]

    matrices = load_placement("out/matrices/placement.json")
    rows = {row["name"]: row for row in matrices["ranking"]}
    assert matrices["proven"]
    assert (matrices["n_layouts"], matrices["n_possible"]) == (3920, 280)
    assert f"number {rows['planned']['rank']}." in TEXT
    # "two thirds", "four times": to the precision of the words.
    assert rows["best"]["figure"] / rows["planned"]["figure"] == pytest.approx(2 / 3, abs=0.05)
    assert rows["worst"]["figure"] / rows["planned"]["figure"] == pytest.approx(4, abs=0.5)
    for name in re.findall(r"^- `(\w+\.\w+)`", TEXT, re.MULTILINE):
        assert (tmp_path / "out/matrices" / name).is_file()

    diagnosis = load_placement("out/diagnosis/placement.json")
    assert {cause["cause"] for cause in diagnosis["causes"]} == {
        "cubic_stiffness",
        "coulomb_friction",
        "freeplay",
    }
    assert any("times 0.1" in drive["excitation"] for drive in diagnosis["drives"])

    capsys.readouterr()
    (code,) = blocks(TEXT, "python")
    exec(code, {})
    said = capsys.readouterr().out
    assert "best 1 " in said


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", TEXT):
        assert (ROOT / "docs" / target).exists(), target
