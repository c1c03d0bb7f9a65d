"""The page on validation is true: its command runs, and its limits are those in force."""

import dataclasses
import re
import tomllib
from pathlib import Path

from lab.scenario import Validating
from lab.validation import ASME, ECSS, NASA, Limits
from tests.tutorial import blocks, run

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "docs/validation.md").read_text("utf-8")


def test_the_command_ends_with_the_count(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (command,) = (line for block in blocks(TEXT, "sh") for line in block.splitlines())
    run(command)
    told = r"^validation: \d+ pass(, \d+ fail)?(, \d+ undecided)?$"
    assert re.search(told, capsys.readouterr().out, re.MULTILINE)
    assert "<h2>Validation</h2>" in (tmp_path / "out/chain7_short/report.html").read_text("utf-8")


def test_the_limits_are_those_in_force():
    rows = re.findall(
        r"^\| ([^|]+) \| at (most|least) ([\d.]+)( %)? \| `(\w+)` \| ([^|]+) \|$", TEXT, re.MULTILINE
    )
    told = {key: float(value) / (100 if percent else 1) for _, _, value, percent, key, _ in rows}
    assert told == dataclasses.asdict(Limits())
    for *_, sources in rows:
        assert set(sources.split(", ")) <= {NASA, ECSS}
    assert ASME in TEXT


def test_the_table_shown_is_one_of_a_scenario():
    (text,) = blocks(TEXT, "toml")
    asked = tomllib.loads(text)["validation"]
    assert dataclasses.asdict(Validating(**asked).limits()) == dataclasses.asdict(Limits()) | asked
