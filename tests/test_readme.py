"""What the README shows is true."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from lab import catalogue
from lab.cli import cli
from tests.tutorial import run

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_the_python_lines_run(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    (code,) = blocks("python")
    names = {}
    exec(code, names)
    matrices, truth = names["found"].second_order, names["rig"].second_order()
    order = [truth.dofs.index(dof) for dof in matrices.dofs]
    error = matrices.stiffness - truth.stiffness[np.ix_(order, order)]
    # One chance in ten thousand for each entry.
    assert np.all(np.abs(error) < 4 * matrices.stiffness_std)
    said = capsys.readouterr().out
    assert "Modes(" in said
    # The model is the one that was simulated.
    assert said.endswith("consistent\n")


@pytest.mark.slow
def test_the_first_ten_minutes_come_to_what_the_text_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)  # names of the catalogue need no checkout
    minutes = README[README.index("## The first ten minutes") : README.index("## Commands")]
    run("lab run chain3_pulse --quiet")
    commands = [
        line for block in re.findall(r"```sh\n(.*?)```", minutes, re.DOTALL) for line in block.splitlines()
    ]
    diagnosed, others = commands[:2], commands[2:]
    assert len(others) == 5
    for command in others:
        run(command)
    found, known = (
        json.loads(Path(f"out/{folder}/result.json").read_text("utf-8"))["modes"]
        for folder in ("my_test_modes", "chain3_pulse")
    )
    # Universal files keep double precision, and ERA loses four digits of it at most.
    assert [mode["frequency_hz"] for mode in found] == pytest.approx(
        [m["frequency_hz"] for m in known], rel=1e-12
    )
    placement = json.loads(Path("out/truss_placement/placement.json").read_text("utf-8"))
    assert (len(placement["sensors"]), len(placement["actuators"])) == (5, 4)
    # The tutorial on diagnosis runs the same two, with folders and names written out, and tells what they come to.
    tutorial = (ROOT / "docs/diagnosis.md").read_text("utf-8")
    full = "lab run scenarios/chain3_hardening.toml --out out/hardening --quiet"
    assert diagnosed[0] == "lab run chain3_hardening"
    assert full in tutorial
    assert diagnosed[1] == "lab diagnose out/chain3_hardening/recording.h5 --model chain3_uncoupled"
    assert "lab diagnose out/hardening/recording.h5 --model models/chain3_uncoupled.xml " in tutorial


def test_the_first_command_runs_a_scenario_and_names_its_folder():
    first, view = blocks("sh")[0], blocks("sh")[2]
    name = re.search(r"&& lab run (\w+)\n$", first)[1]
    assert name in catalogue.files("scenarios")
    assert view == f"lab view out/{name}\n"


def test_every_command_is_in_the_table():
    section = README[README.index("## Commands") : README.index("## Scenarios")]
    assert re.findall(r"^\| `lab (\w+)", section, re.MULTILINE) == list(cli.commands)


def test_the_picture_is_small():
    (picture,) = re.findall(r"!\[[^]]+\]\((.+?)\)", README)
    assert (ROOT / picture).read_bytes().startswith(b"\x89PNG")
    assert (ROOT / picture).stat().st_size < 150_000


def test_the_checks_run_the_test_command():
    tests = [block.strip() for block in blocks("sh") if "pytest" in block]
    assert tests == [".venv/bin/pytest -n auto"]
    assert tests[0] in (ROOT / ".ci/run").read_text("utf-8").splitlines()


def test_the_table_lists_every_scenario():
    listed = set(re.findall(r"^\| `(\w+)` \|", README, re.MULTILINE))
    assert set(catalogue.files("scenarios")) == listed


def test_links_lead_somewhere():
    prose = re.sub(r"```.*?```", "", README, flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)#]+)\)", prose):
        assert target.startswith("https://") or (ROOT / target).exists(), target
