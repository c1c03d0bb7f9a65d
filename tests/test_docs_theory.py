"""The page on theory is true where it can be tried: its programs run, its sources are all used, its links lead somewhere."""

import re
from pathlib import Path

from tests.tutorial import blocks

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "docs/theory.md").read_text("utf-8")


def test_the_equations_hold(monkeypatch):
    monkeypatch.chdir(ROOT)
    programs = blocks(TEXT, "python")
    assert len(programs) == 5
    names = {}
    for program in programs:
        exec(program, names)


def test_every_source_is_used_and_every_number_has_a_source():
    body, listed = TEXT.split("## Sources")
    prose = re.sub(r"```.*?```|\$\$.*?\$\$|\$[^$\n]*\$", "", body, flags=re.DOTALL)
    used = {
        int(number)
        for bracket in re.findall(r"\[(\d[^\]]*)\](?!\()", prose)
        for part in bracket.split(";")
        for number in re.findall(r"^\s*(\d+)", part)
    }
    assert used == {int(number) for number in re.findall(r"^(\d+)\. ", listed, re.MULTILINE)}


def test_the_files_it_names_exist():
    for path in re.findall(r"`((?:lab|identification|benchmarks)/[\w/]+\.py)`", TEXT):
        assert (ROOT / path).is_file(), path


def test_the_table_of_contents_has_every_section():
    sections = re.findall(r"^## (.+)$", TEXT, re.MULTILINE)
    assert re.findall(r"^- \[(.+?)\]\(#", TEXT, re.MULTILINE) == sections
    for title, anchor in re.findall(r"^- \[(.+?)\]\(#(.+?)\)", TEXT, re.MULTILINE):
        # The rule by which headings become anchors.
        assert anchor == re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")
