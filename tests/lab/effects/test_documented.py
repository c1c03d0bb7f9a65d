"""Every cause has its entry in the documentation, complete and true."""

import re
from pathlib import Path

import pytest

from lab.effects import EFFECTS
from tests.lab.effects.cases import CASES

PAGE = Path(__file__).parents[3] / "docs/effects.md"
ENTRIES = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", PAGE.read_text("utf-8"), re.M | re.S))


def test_causes_and_entries_are_the_same():
    assert list(ENTRIES) == list(EFFECTS)


@pytest.mark.parametrize("cause", EFFECTS)
def test_an_entry_is_complete(cause):
    entry = ENTRIES[cause]
    for part in ("Law", "Parameters", "Sits", "In MuJoCo", "Look-alikes"):
        assert f"- **{part}**" in entry, part
    for name, unit in EFFECTS[cause].units.items():
        assert f"`{name}`" in entry
        assert unit in entry


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.order])
def test_an_entry_promises_the_order_that_is_tested(name):
    case = CASES[name]
    assert f"p = {case.order:.0f}" in ENTRIES[case.effect.cause]
