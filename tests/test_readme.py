"""What the README shows is true."""

import re
from pathlib import Path

import numpy as np

from lab import catalogue

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_the_python_lines_run(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    (code,) = blocks("python")
    names = {}
    exec(code, names)
    # Pairwise springs 1.0 and ground springs 2.0; simulated to 1e-9, which the extraction keeps to about 1e-7.
    truth = np.array([[4.0, -1.0, -1.0], [-1.0, 4.0, -1.0], [-1.0, -1.0, 4.0]])
    np.testing.assert_allclose(names["found"].second_order.stiffness, truth, atol=1e-6)
    assert "Modes(" in capsys.readouterr().out


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
