"""An installed wheel brings its models and scenarios along."""

import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.mark.slow
def test_a_wheel_knows_its_models_and_scenarios(tmp_path):
    built = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", "."]
    subprocess.run([*built, str(ROOT)], check=True, cwd=tmp_path, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "site")}
    listed = subprocess.run(
        [sys.executable, "-P", "-m", "lab", "list", "models", "scenarios", "--json"],
        check=True,
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert {kind: list(names) for kind, names in json.loads(listed.stdout).items()} == {
        "models": sorted(path.stem for path in (ROOT / "models").glob("*.xml")),
        "scenarios": sorted(path.stem for path in (ROOT / "scenarios").glob("*.toml")),
    }


def test_the_lock_names_no_address_and_pins_by_hash():
    lines = (ROOT / "requirements.txt").read_text("utf-8").splitlines()
    assert not [line for line in lines if "://" in line or line.startswith("--")]
    pinned = [line for line in lines if line and line[0] not in " #"]
    assert pinned
    assert all("==" in line for line in pinned)
    assert all(lines[lines.index(line) + 1].strip().startswith("--hash=sha256:") for line in pinned)


def test_the_lock_covers_the_project():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    wanted = [
        *project["project"]["dependencies"],
        *project["dependency-groups"]["dev"],
        *project["build-system"]["requires"],
    ]
    pinned = set(re.findall(r"^([\w.-]+)==", (ROOT / "requirements.txt").read_text("utf-8"), re.MULTILINE))
    assert {re.split(r"[<>=]", each)[0] for each in wanted} <= pinned
