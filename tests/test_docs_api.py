"""The API reference is built by its one command, and leaves nothing of the front doors out."""

import importlib
import inspect
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("lab", "identification")


class Page(HTMLParser):
    """Links and anchors of a page, whose tags must nest."""

    def __init__(self, path):
        super().__init__()
        self.open, self.links, self.anchors, self.text = [], set(), set(), []
        self.feed(path.read_text("utf-8"))
        assert not self.open

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if tag != "meta":
            self.open.append(tag)
        if "href" in given:
            self.links.add(given["href"])
        if "id" in given:
            assert given["id"] not in self.anchors
            self.anchors.add(given["id"])

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


@pytest.mark.slow
def test_the_command_writes_pages_whose_links_lead_somewhere(tmp_path):
    command = [sys.executable, str(ROOT / "docs/api.py"), str(tmp_path / "api")]
    said = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout
    pages = {path.name: Page(path) for path in (tmp_path / "api").glob("*.html")}
    assert said.startswith(f"{len(pages)} pages; begin with ")
    for name, page in pages.items():
        for link in page.links:
            target, _, anchor = link.partition("#")
            assert target in pages, (name, link)
            assert not anchor or anchor in pages[target].anchors, (name, link)
    index = "".join(pages["index.html"].text)
    for package in PACKAGES:
        for name in importlib.import_module(package).__all__:
            assert f"{package}.{name}" in index
    era = "".join(pages["identification.era.html"].text)
    assert "era(markov, order=None, *, form='balanced'" in era
    assert "State space whose impulse response matches the Markov parameters" in era
    assert "OrderError" in era


def undescribed(function):
    """Arguments that the docstring of a function leaves out; a single one may be told by its first sentence."""
    text = inspect.getdoc(function) or ""
    entries = re.findall(r"^ {4}([\w*, ]+):", text, re.MULTILINE)
    described = {name.strip("* ") for entry in entries for name in entry.split(",")}
    parameters = list(inspect.signature(function).parameters)
    return [name for name in parameters if name not in described and (len(parameters) > 1 or not text)]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_argument_of_the_front_doors_is_described(package):
    module = importlib.import_module(package)
    offered = {name: getattr(module, name) for name in module.__all__}
    functions = {name: value for name, value in offered.items() if inspect.isfunction(value)}
    assert len(functions) > 10
    assert {name: missing for name, value in functions.items() if (missing := undescribed(value))} == {}
