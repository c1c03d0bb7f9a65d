"""The report read back as a browser and as a parser would."""

import hashlib
import html
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from identification.recording import Channel, Record, Recording
from lab.show.figures import draw
from lab.show.figures.canvas import plain, power_of_ten
from lab.show.figures.responses import chosen_pairs
from lab.show.report import write_report
from lab.show.verdict import verdict
from lab.validation import validate
from tests.lab.showcase import chain_result, chain_rig, pulse_recording, random_recording

EVIL = '<script>alert(1)</script> & "$x$" \x00'
VOID = {"meta", "br", "link", "img", "hr", "input"}
BLOCKS = {"p", "div", "table", "ul", "ol", "dl", "pre", "figure", "h1", "h2", "h3", "header", "main"}
PARENTS = {
    "li": {"ul", "ol"},
    "dt": {"dl"},
    "dd": {"dl"},
    "caption": {"table"},
    "thead": {"table"},
    "tbody": {"table"},
    "tr": {"thead", "tbody"},
    "th": {"tr"},
    "td": {"tr"},
    "figcaption": {"figure"},
}
"""Where HTML allows these elements."""


class Page(HTMLParser):
    """Collects text, tags and names, and checks that tags nest."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.ids, self.links, self.text = [], Counter(), Counter(), [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags[tag] += 1
        assert tag not in BLOCKS or "p" not in self.open, f"{tag} inside a paragraph"
        assert tag not in PARENTS or self.open[-1] in PARENTS[tag], f"{tag} inside {self.open[-1]}"
        assert len({key for key, _ in attrs}) == len(attrs), f"{tag} has an attribute twice"
        for key, value in attrs:
            if key == "id":
                self.ids[value] += 1
            if key in ("href", "src") or key.endswith(":href"):
                self.links.append(value)
            assert not key.startswith("on")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def rig():
    return chain_rig("chain3_coupled", inputs=["force1", "force2"], outputs=["acc2.x", "acc3.x"])


@pytest.fixture(scope="module")
def page(rig, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    (path.parent / "recording.h5").write_bytes(b"samples")
    facts = {"Seed": "7"}
    scenario = '\ntitle = "a < b"\n\tend'
    write_report(
        path,
        chain_result(rig),
        pulse_recording(rig),
        scenario_text=scenario,
        command="lab run x.toml",
        facts=facts,
    )
    return path


def test_page_is_whole_and_needs_nothing_else(page):
    text = page.read_text(encoding="utf-8")
    parsed = Page(text)
    assert text.startswith("<!DOCTYPE html>")
    assert parsed.tags["script"] == 0
    assert max(parsed.ids.values()) == 1
    for link in parsed.links:
        assert link.startswith(("#", "data:image/png;base64,")), link
        assert not link.startswith("#") or link[1:] in parsed.ids
    assert not re.search(r"https?:|@import|url\((?!#)", text)
    # Names inside the drawings are found in the same drawing.
    for name in re.findall(r"url\(#([^)]+)\)", text):
        assert name in parsed.ids


def test_order_is_verdict_tables_figures_reproduction(page):
    text = page.read_text(encoding="utf-8")
    headings = re.findall(r"<h2[^>]*>(.*?)</h2>", text)
    expected = [
        "Criteria",
        "Modes",
        "Mass, damping, stiffness",
        "Figures",
        "Why this result",
        "Warnings",
        "To reproduce",
    ]
    assert headings == expected
    assert text.index('class="verdict passed"') < text.index("<h2>")


def test_everything_to_reproduce_is_there(page):
    text = page.read_text(encoding="utf-8")
    blocks = [html.unescape(block) for block in re.findall(r"<pre>\n(.*?)</pre>", text, re.S)]
    assert blocks == ["lab run x.toml", '\ntitle = "a < b"\n\tend']
    visible = " ".join(Page(text).text)
    assert hashlib.sha256(b"samples").hexdigest() in visible
    assert f"numpy {np.__version__}" in visible
    assert "n_rows = 50" in visible
    assert re.search(r"Seed\s+7", visible)


def test_modes_and_matrices_stand_in_the_tables(page, rig):
    visible = " ".join("".join(Page(page.read_text(encoding="utf-8")).text).split())
    result = chain_result(rig)
    for frequency in result.modes.frequency_hz:
        assert f"{frequency:.4f} ±" in visible or f"{frequency:.5f} ±" in visible
    assert f"{result.second_order.stiffness[0, 0]:.9f}" in visible


def test_text_from_data_stays_text(tmp_path):
    """Every place where a name from outside can appear, drawings included."""
    u, y = np.random.default_rng(0).standard_normal((2, 1, 600))
    channels = (Channel(EVIL, "N", EVIL),), (Channel(EVIL + "y", "m/s^2", EVIL),)
    recording = Recording((Record("random", u, y),), *channels, 50.0, title=EVIL)
    rig = chain_rig("chain3_coupled", inputs=["force1"], outputs=["acc1.x"])
    result = chain_result(rig, title=EVIL)
    modes, truth = (replace(m, outputs=channels[1]) for m in (result.modes, result.truth_modes))
    named = tuple(f"{EVIL}{i}" for i in range(3))
    result = replace(
        result,
        modes=modes,
        truth_modes=truth,
        second_order=replace(result.second_order, dofs=named),
        truth_second_order=replace(result.truth_second_order, dofs=named),
        warnings=(EVIL,),
        notes=(EVIL,),
    )
    path = tmp_path / "report.html"
    write_report(path, result, recording, scenario_text=EVIL, command=EVIL, facts={EVIL: EVIL})
    text = path.read_text(encoding="utf-8")
    parsed = Page(text)
    assert parsed.tags["script"] == 0
    assert "\x00" not in text
    shown = [data for data in parsed.text if "<script>alert(1)</script>" in data]
    # Title twice, command, scenario, fact and its name, warning, note; three degrees of freedom as heads of the
    # rows and columns of nine matrices.
    assert len(shown) >= 8 + 9 * 6
    # In drawings long names are cut in the middle, and still text.
    assert any(data.startswith("<script>") and "…" in data for data in parsed.text)
    assert any("$x$" in data for data in shown)


def test_same_data_same_bytes(page, rig, tmp_path):
    again = tmp_path / "report.html"
    (tmp_path / "recording.h5").write_bytes(b"samples")
    write_report(
        again,
        chain_result(rig),
        pulse_recording(rig),
        scenario_text='\ntitle = "a < b"\n\tend',
        command="lab run x.toml",
        facts={"Seed": "7"},
    )
    assert again.read_bytes() == page.read_bytes()


def test_poor_results_are_reported_too(rig, tmp_path):
    """No mode, no truth, no input, silent channel: fewer tables, no failure, no warning."""
    result = chain_result(rig)
    bare = replace(
        result,
        modes=result.modes.take([False] * 3),
        stable=(),
        second_order=None,
        stabilization=None,
        truth_modes=None,
        truth_second_order=None,
        comparison=None,
        criteria=(),
        warnings=(),
        notes=(),
    )
    silent = Record("ambient", np.zeros((0, 300)), np.zeros((2, 300)))
    recording = Recording((silent,), (), rig.outputs, 20.0)
    path = tmp_path / "report.html"
    write_report(path, bare, recording)
    visible = " ".join(Page(path.read_text(encoding="utf-8")).text)
    assert visible.count("No mode was found.") == 2


def test_large_matrices_are_drawn_instead(tmp_path, monkeypatch):
    monkeypatch.setattr("lab.show.report.draw", lambda *_, **__: [])  # no other figure matters here
    rig = chain_rig("truss", inputs=["force_u1"], outputs=["acc1.x"])
    result = chain_result(rig)
    path = tmp_path / "report.html"
    big = np.eye(13)
    dofs = tuple(f"d{i}" for i in range(13))
    large = replace(result.second_order, mass=big, damping=big, stiffness=big, dofs=dofs)
    write_report(path, replace(result, second_order=large), random_recording(rig, 1000))
    parsed = Page(path.read_text(encoding="utf-8"))
    assert parsed.ids["figure-matrices"] == 1


def test_figures_of_a_random_test(rig):
    drawings = draw(chain_result(rig), random_recording(rig, 5000))
    assert [d.name for d in drawings] == [
        "time",
        "spectra",
        "frf",
        "nyquist",
        "coherence",
        "shapes",
        "error-bars",
        "stabilization",
        "mac",
        "singular",
    ]
    named = {d.name: d for d in drawings}
    response = named["frf"]
    assert "driving" not in response.caption  # all four of two inputs and two outputs are shown
    assert "identified" in response.svg
    rejected = set(chain_result(rig).stabilization.label) - {"stable"}
    assert all(reason in named["stabilization"].svg for reason in rejected)
    assert "dB re 1 m/s² / N" in response.svg
    assert "dB re 1 (m/s²)²/Hz" in named["spectra"].svg
    assert "imaginary part" in named["nyquist"].svg
    assert "the truth: about 95 %" in named["error-bars"].caption


def test_driving_points_come_first():
    inputs = tuple(Channel(f"f{i}", "N", f"x{i}") for i in range(3))
    outputs = tuple(Channel(f"y{i}", "m", f"x{2 - i}") for i in range(3))
    pairs = chosen_pairs(inputs, outputs)
    assert {(0, 2), (1, 1), (2, 0)} < set(pairs)
    assert len(pairs) == len(set(pairs)) == 4


def test_small_texts():
    assert power_of_ten(1e-12) == "10⁻¹²"
    assert plain("a$b\x07") == "a\\$b\N{REPLACEMENT CHARACTER}"
    assert plain("x" * 20 + "y" * 20, 9) == "xxxx…yyyy"


def test_names_in_other_scripts_reach_the_browser(tmp_path):
    """The drawing font lacks them, the reader's fonts have them: no warning, no empty boxes."""
    names = ("加速度1", "⠁⠂", "επιτάχυνση", "\U00020000")
    outputs = tuple(Channel(name, "m/s^2") for name in names)
    y = np.random.default_rng(0).standard_normal((4, 600))
    recording = Recording((Record("ambient", np.zeros((0, 600)), y),), (), outputs, 50.0)
    drawings = draw(
        chain_result(chain_rig("chain3_coupled", inputs=["force1"], outputs=["acc1.x"])), recording
    )
    for name in names[:3]:
        assert name in drawings[0].svg
        assert name in drawings[1].svg
    assert "\N{REPLACEMENT CHARACTER}" in drawings[0].svg  # beyond the stand-ins, yet no failure


def test_the_criteria_of_the_field_stand_in_a_table_with_their_sources(rig, tmp_path, monkeypatch):
    monkeypatch.setattr("lab.show.report.draw", lambda *_, **__: [])  # no figure matters here
    result = chain_result(rig)
    judged = replace(result, criteria=(), validation=validate(result))
    write_report(tmp_path / "report.html", judged, pulse_recording(rig))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'class="verdict passed">Passed: all criteria of the field are met.' in text
    visible = " ".join("".join(Page(text).text).split())
    assert "3 of 3 modes of the model were found" in visible
    assert "NASA-STD-5002, ECSS-E-ST-32-11C" in visible
    names = [each.name for each in judged.validation]
    assert all(f'<th scope="row" class="wrap">{name}</th>' in text for name in names)
    broken = replace(
        judged, validation=(replace(judged.validation[0], outcome="fail"), *judged.validation[1:])
    )
    assert verdict(broken).sentence.startswith(f"Failed by the criteria of the field: {names[0]}. 3 of 3")
    open_ = replace(
        judged, validation=(replace(judged.validation[0], outcome="undecided"), *judged.validation[1:])
    )
    assert verdict(open_).outcome == "found"
    assert verdict(open_).sentence.startswith("Undecided by the criteria of the field")
