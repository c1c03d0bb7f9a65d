"""Reports in a real browser: they open without a complaint, names stay text, a phone shows them, all pages print."""

import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from identification.recording import Channel, Record, Recording
from lab.show.diagnosis_report import write_diagnosis_report
from lab.show.report import write_report
from lab.validation import validate
from tests.lab.diagnosed import explained, recorded, two_masses
from tests.lab.showcase import chain_result, chain_rig
from tests.lab.test_show_report import Page

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
EVIL = "<script>alert(1)</script>"
PHONE = 390
"""Width of a common phone, in CSS pixels."""
MEASURE = """<!DOCTYPE html><body><iframe src="{0}" style="width:{1}px;height:800px;border:0"
onload="document.body.dataset.width = this.contentDocument.documentElement.scrollWidth"></iframe>"""

pytestmark = [pytest.mark.slow, pytest.mark.skipif(BROWSER is None, reason="needs Chromium")]


@pytest.fixture(scope="module")
def browse(tmp_path_factory):
    """What the browser says, with a profile of its own."""
    profile = tmp_path_factory.mktemp("profile")
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--hide-scrollbars",
        "--allow-file-access-from-files",
        f"--user-data-dir={profile}",
        "--enable-logging=stderr",
        "--v=0",
    ]

    def run(page, *arguments):
        return subprocess.run(
            [BROWSER, *options, *arguments, page.as_uri()],
            capture_output=True,
            text=True,
            timeout=120,
            check=True,
        )

    return run


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """A report of a test and one of a diagnosis, a channel of each named like a script."""
    folder = tmp_path_factory.mktemp("reports")
    u, y = np.random.default_rng(0).standard_normal((2, 1, 4000))
    recording = Recording(
        (Record("random", u, y),), (Channel("f", "N"),), (Channel(EVIL, "m/s^2"),), 50.0, title=EVIL
    )
    result = chain_result(chain_rig("chain3_coupled", inputs=["force1"], outputs=["acc1.x"]))
    named, true = (replace(m, outputs=recording.outputs) for m in (result.modes, result.truth_modes))
    result = replace(result, modes=named, truth_modes=true, validation=validate(result), warnings=(EVIL,))
    write_report(folder / "test.html", result, recording, scenario_text=EVIL, command=EVIL)
    rig = two_masses()
    measured = recorded(rig)
    outputs = (Channel(EVIL, "m/s^2", "q0"), measured.outputs[1])
    diagnosis = explained(rig, measured)
    write_diagnosis_report(
        folder / "diagnosis.html", diagnosis, replace(measured, outputs=outputs, title=EVIL)
    )
    return {name: folder / f"{name}.html" for name in ("test", "diagnosis")}


def test_the_browser_would_complain(browse, tmp_path):
    """What the next test looks for appears where something is wrong."""
    page = tmp_path / "broken.html"
    page.write_text("<!DOCTYPE html><title>x</title><script>nowhere()</script>")
    assert "CONSOLE" in browse(page, "--dump-dom").stderr


@pytest.mark.parametrize("name", ["test", "diagnosis"])
def test_it_opens_and_names_stay_text(browse, pages, name):
    done = browse(pages[name], "--dump-dom")
    assert "CONSOLE" not in done.stderr
    # The browser's own tree has what the file has: nothing was dropped as an error, nothing became a tag.
    ours, theirs = Page(pages[name].read_text(encoding="utf-8")), Page(done.stdout)
    assert theirs.tags == ours.tags
    assert theirs.tags["script"] == 0
    assert any(EVIL in text for text in theirs.text)


@pytest.mark.parametrize("name", ["test", "diagnosis"])
def test_a_phone_scrolls_it_downwards_only(browse, pages, name, tmp_path):
    frame = tmp_path / "frame.html"
    frame.write_text(MEASURE.format(pages[name].as_uri(), PHONE))
    width = int(re.search(r'data-width="(\d+)"', browse(frame, "--dump-dom").stdout)[1])
    assert width == PHONE


@pytest.mark.parametrize("name", ["test", "diagnosis"])
def test_all_of_it_prints(browse, pages, name, tmp_path):
    printed = tmp_path / "report.pdf"
    browse(pages[name], f"--print-to-pdf={printed}")
    content = printed.read_bytes()
    assert content.startswith(b"%PDF-")
    n_pages = len(re.findall(rb"/Type\s*/Page\b", content))
    assert n_pages >= 3
    if shutil.which("pdftotext") is None:
        return
    done = subprocess.run(["pdftotext", str(printed), "-"], capture_output=True, text=True, check=True)
    sheets = done.stdout.split("\f")[:-1]
    assert len(sheets) == n_pages
    assert all(sheet.strip() for sheet in sheets)
    for heading in re.findall(r"<h2[^>]*>(.*?)</h2>", pages[name].read_text(encoding="utf-8")):
        assert heading in done.stdout
