"""A diagnosis in words, on a page and in the viewer, read back."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from identification.recording import Channel
from lab.diagnosis.outcome import Errors, Prediction, Quantity, SpectralPrediction
from lab.diagnosis_summary import diagnosis_summary
from lab.effects import EFFECTS
from lab.show.diagnosis_report import write_diagnosis_report
from lab.show.figures.diagnosis import figures_of, predictions, worst_outputs
from lab.show.findings import (
    alternative_table,
    calibration_table,
    error_table,
    finding_table,
    parameter,
    verdict_of,
)
from lab.show.headline import headline
from lab.show.model_modes import mode_changes
from lab.show.rerun_log.diagnosis import write_diagnosis_rrd
from lab.show.rerun_log.spectra import level_range
from tests.lab.diagnosed import RATE, explained, recorded, two_masses
from tests.lab.showcase import motion_of
from tests.lab.test_show_report import EVIL, Page
from tests.lab.test_show_rerun import Read

SAYS = "The spring spring0_1 hardens with the cube of its extension."
FALL = "On data kept aside the error falls from 30 % (as given) and 8 % (calibrated) to 1.02 %; the noise floor is 1 %."


@pytest.fixture(scope="module")
def recording():
    return recorded(two_masses())


@pytest.fixture(scope="module")
def diagnosis(recording):
    return explained(two_masses(), recording)


@pytest.fixture(scope="module")
def page(diagnosis, recording, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    (path.parent / "diagnosis.json").write_text("{}")
    write_diagnosis_report(path, diagnosis, recording, command="lab diagnose a.h5", facts={"Model": "a.xml"})
    return path


def test_the_three_verdicts(diagnosis, recording):
    said = verdict_of(diagnosis, recording)
    assert (said.outcome, said.sentence) == ("found", f"Explained: {SAYS} {FALL}")
    errors = Errors(0.01, 0.3, 0.0101, 0.0101)
    clean = verdict_of(replace(diagnosis, verdict="consistent", findings=(), errors=errors), recording)
    assert clean.outcome == "passed"
    assert clean.sentence.startswith("Consistent: ")
    assert "it misses 1.01 % of the signal, and the noise floor is 1 %" in clean.sentence
    left = verdict_of(replace(diagnosis, verdict="unexplained"), recording)
    assert left.outcome == "failed"
    assert re.match(r"Unexplained: .* channel (acc0\.x|pos1) \(.* %.* in record [01] from ", left.sentence)
    assert left.sentence.endswith(f"What was explained so far: {SAYS} {FALL}")
    nothing = verdict_of(replace(diagnosis, verdict="unexplained", findings=()), recording)
    assert "so far" not in nothing.sentence


def test_the_headline_is_one_sentence_that_needs_no_other(diagnosis):
    assert headline(diagnosis).sentence == (
        "Explained: one thing is wrong with the model, cubic stiffness at spring0_1; with that put right the model misses "
        "1.02 % of the signal instead of 30 %, and noise alone makes 1 %."
    )
    clean = headline(replace(diagnosis, verdict="consistent", findings=()))
    assert (clean.outcome, clean.sentence.split(";")[0]) == (
        "passed",
        "Consistent: the model describes this test",
    )
    assert clean.sentence.endswith(
        "why the difference is no finding is said under warnings."
    )  # 8 % against 1 %
    left = headline(replace(diagnosis, verdict="unexplained"))
    assert left.outcome == "failed"
    assert (
        "cubic stiffness at spring0_1 accounts for part of it, and no known cause for the rest"
        in left.sentence
    )
    nothing = headline(replace(diagnosis, verdict="unexplained", findings=()))
    assert nothing.sentence == (
        "Unexplained: the model is wrong (at its best it misses 8 % of the signal, where noise alone makes 1 %), and no known "
        "cause accounts for all of it."
    )


def test_the_modes_of_both_models_stand_side_by_side(diagnosis):
    """A mass added to the second body lowers both modes as the eigenvalues of the state matrix say."""
    heavier = EFFECTS["mass_change"].of("mass1", {"delta_mass": 0.5}).apply(diagnosis.nominal)
    rows = mode_changes(replace(diagnosis, extended=heavier)).rows
    K, C = np.array([[1300.0, -900.0], [-900.0, 900.0]]), np.array([[2.5, -1.5], [-1.5, 1.5]])

    def frequencies(mass):
        over = np.diag(1 / np.array(mass))
        A = np.block([[np.zeros((2, 2)), np.eye(2)], [-over @ K, -over @ C]])
        return np.sort(np.abs(np.linalg.eigvals(A)))[::2] / (2 * np.pi)

    given, extended = frequencies([1.0, 2.0]), frequencies([1.0, 2.5])
    assert [row[1] for row in rows] == [f"{f:.5g}" for f in given]
    assert [row[2] for row in rows] == [f"{f:.5g}" for f in extended]
    assert [row[-1] for row in rows] == ["BEYOND", "within"]
    same = mode_changes(replace(diagnosis, extended=diagnosis.nominal)).rows
    assert [row[3:] for row in same] == [("+0 %", row[4], row[4], "1.0000", "within") for row in same]


def test_a_new_mode_is_said_to_be_new(diagnosis):
    values = {"mass": 0.05, "frequency_hz": 3.5, "damping_ratio": 0.01}
    oscillator = EFFECTS["attached_oscillator"].of("mass1", values)
    rows = mode_changes(replace(diagnosis, extended=oscillator.apply(diagnosis.nominal))).rows
    assert len(rows) == 3
    assert [row[-1] for row in rows].count("new") == 1


def test_tables(diagnosis):
    assert finding_table(diagnosis).rows == (
        ("cubic stiffness", "spring0_1", "k3 = (5000000 ± 40000) N/m^3", "1234", "99 %"),
    )
    rows = alternative_table(diagnosis).rows
    assert rows[0] == ("bilinear stiffness", "spring0_1", "800.2", "434.2", "")
    assert rows[1][3:] == ("1238", "A stronger push would tell a stop from a cubic.")
    plain = replace(diagnosis, alternatives=diagnosis.alternatives[:1])
    assert alternative_table(plain).heads == ("Cause", "Location", "Evidence", "Worse by")
    assert error_table(diagnosis).rows == (
        ("model as given", "30 %", "30"),
        ("calibrated", "8 %", "8"),
        ("extended by the findings", "1.02 %", "1.02"),
        ("noise floor", "1 %", "1"),
    )
    assert calibration_table(diagnosis).rows[1] == (
        "stiffness spring0_1",
        "900.000",
        "884.0 ± 2.0",
        "-1.8 %",
    )


@pytest.mark.parametrize(
    ("quantity", "text"),
    [
        (Quantity(-0.2512, 0.0031, "1"), "x = -0.2512 ± 0.0031"),
        (Quantity(0.004, math.nan, "s"), "x = 0.00400000 s"),
        (Quantity(12.5, 0.25, "N"), "x = (12.50 ± 0.25) N"),
    ],
)
def test_a_parameter_has_its_unit_and_digits(quantity, text):
    assert parameter("x", quantity) == text


def test_what_is_not_known_is_said(diagnosis):
    blind = replace(
        diagnosis,
        errors=Errors(0.0, math.nan, 0.1, 0.1),
        findings=(replace(diagnosis.findings[0], holdout_gain=math.nan),),
    )
    assert error_table(blind).rows[0] == ("model as given", "not known", "not known")
    assert finding_table(blind).rows[0][-1] == "not known"


def test_one_screen_tells_it(diagnosis, recording):
    text = diagnosis_summary(diagnosis, recording)
    lines = text.splitlines()
    assert len(lines) < 40
    assert max(map(len, lines)) <= 100
    assert lines[0].startswith("Explained: ")
    assert "k3 = (5000000 ± 40000) N/m^3" in text
    assert "calibration moved most: stiffness spring0_1 -1.8 %, mass mass0 +0.2 %" in text
    assert "warning: Too short" in text
    assert "not told by these data: One shaker" in text
    bare = replace(
        diagnosis,
        verdict="consistent",
        findings=(),
        alternatives=(),
        calibration={},
        warnings=(),
        unlearnable=(),
    )
    assert [block.split("\n")[0] for block in diagnosis_summary(bare, recording).split("\n\n")][1:] == [
        "error on data kept aside"
    ]


def test_the_page_says_the_verdict_first_and_needs_nothing_else(page):
    text = page.read_text(encoding="utf-8")
    parsed = Page(text)
    assert re.findall(r"<h2[^>]*>(.*?)</h2>", text) == [
        "Findings",
        "Alternatives to the first finding",
        "Errors on data kept aside",
        "What it means for the modes",
        "Words on this page",
        "Figures",
        "What these data cannot tell",
        "Noise of the outputs",
        "Calibration",
        "Warnings",
        "To reproduce",
    ]
    assert text.index('class="verdict found"') < text.index("<h2>")
    assert max(parsed.ids.values()) == 1
    assert not re.search(r"https?:|@import|url\((?!#)", text)
    for link in parsed.links:
        assert link.startswith(("#", "data:image/png;base64,"))
    visible = " ".join("".join(parsed.text).split())
    for part in (
        SAYS,
        "Force of the spring spring0_1 over its extension",
        "k3 = (5000000 ± 40000) N/m^3",
        "434.2",
        "1.0020 ± 0.0010",
        "One shaker cannot tell its gain",
        "0.0200 ± 0.0010 m/s²",
        "SHA-256 of diagnosis.json",
        "Causes weighed.",
        "the error that noise in the measurements makes by itself",
        "calibrated less nominal".capitalize(),
    ):
        assert part in visible


def test_same_data_same_bytes(page, diagnosis, recording, tmp_path):
    (tmp_path / "diagnosis.json").write_text("{}")
    again = tmp_path / "report.html"
    write_diagnosis_report(again, diagnosis, recording, command="lab diagnose a.h5", facts={"Model": "a.xml"})
    assert again.read_bytes() == page.read_bytes()


def test_text_from_data_stays_text(diagnosis, recording, tmp_path):
    outputs = (Channel(EVIL, "m/s^2"), Channel(EVIL + "2", "m"))
    named = replace(recording, outputs=outputs, title=EVIL)
    finding = replace(diagnosis.findings[0], effect=EFFECTS["sensor_swap"].of(EVIL, {}), says=EVIL)
    evil = replace(
        diagnosis,
        verdict="unexplained",
        findings=(finding,),
        alternatives=(replace(diagnosis.alternatives[1], location=EVIL, advice=EVIL),),
        calibration={EVIL: diagnosis.calibration["mass mass0"]},
        warnings=(EVIL,),
    )
    path = tmp_path / "report.html"
    write_diagnosis_report(path, evil, named, command=EVIL, facts={EVIL: EVIL})
    text = path.read_text(encoding="utf-8")
    parsed = Page(text)
    assert parsed.tags["script"] == 0
    assert "\x00" not in text
    # Title twice, verdict, location, sentence, alternative and its advice, calibration, warning, command, fact and name.
    assert sum("<script>alert(1)</script>" in data for data in parsed.text) >= 12


def drawn(diagnosis, recording):
    """The figures that the data support."""
    return [each for figure in figures_of(diagnosis, recording) if (each := figure()) is not None]


def test_figures_show_the_models_there_are(diagnosis, recording):
    drawings = {each.name: each for each in drawn(diagnosis, recording)}
    assert list(drawings) == ["prediction", "residual-time", "residual-frequency", "residual-amplitude"]
    for each in drawings.values():
        assert ">extended" in each.svg
    for name in ("residual-time", "residual-frequency", "residual-amplitude"):
        assert "noise floor" in drawings[name].svg
    unnamed = replace(diagnosis, findings=())
    assert ">extended" not in predictions(unnamed, recording, worst_outputs(unnamed)).svg


def test_poor_data_are_drawn_too(diagnosis, recording):
    """Few samples, gaps, a dead channel, no noise, nothing kept aside: fewer figures, no failure, no warning."""
    y = np.zeros((2, 6))
    y[0] = [1.0, -1.0, np.nan, 2.0, 0.5, 0.1]
    short = replace(recording, records=(replace(recording.records[0], inputs=np.zeros((1, 6)), outputs=y),))
    poor = replace(
        diagnosis, errors=Errors(0.0, math.nan, 0.0, 0.0), predictions=(Prediction(y, y, y, y, 6),)
    )
    assert [each.name for each in drawn(poor, short)] == [
        "prediction",
        "residual-time",
        "residual-amplitude",
    ]
    assert verdict_of(replace(poor, verdict="unexplained"), short).sentence


def test_of_many_channels_the_worst_are_shown(diagnosis, recording):
    rng = np.random.default_rng(0)
    y = rng.standard_normal((9, 400))
    size = np.arange(9)[:, None]
    off = y + size * rng.standard_normal(y.shape)
    channels = tuple(Channel(f"sensor{i}", "m") for i in range(9))
    record = replace(recording.records[0], inputs=np.zeros((1, 400)), outputs=y)
    many = replace(recording, records=(record,), outputs=channels)
    wrong = replace(diagnosis, predictions=(Prediction(y, off, off, off, 200),))
    first = predictions(wrong, many, worst_outputs(wrong))
    assert [i for i in range(9) if f"sensor{i}" in first.svg] == [3, 4, 5, 6, 7, 8]
    assert "6 of 9 outputs shown" in first.caption


@pytest.fixture(scope="module")
def read(diagnosis, recording, tmp_path_factory):
    path = tmp_path_factory.mktemp("rrd") / "run.rrd"
    motions = tuple(motion_of(rig, recording) for rig in (diagnosis.nominal, diagnosis.nominal))
    write_diagnosis_rrd(path, diagnosis, recording, motions=motions)
    return Read(path)


def test_every_view_looks_at_an_entity(read):
    views = read.views()
    assert [origin for _, origin in views if origin not in read.entities] == []
    kinds = [kind for kind, _ in views]
    # Two channels, predicted and residual; two structures; one summary; as plots the ranked causes, the residual of
    # two channels over frequency and over amplitude, and the force of the spring that hardens.
    expected = {"TimeSeries": 4, "3D": 2, "TextDocument": 1, "2D": 6}
    assert {kind: kinds.count(kind) for kind in kinds} == expected
    assert "/structure/extended/bodies/mass1" in read.entities


def test_lines_are_the_signals_one_record_after_the_other(read, diagnosis):
    (entity,) = (name for name in read.entities if name.startswith("/predictions") and "acc0" in name)
    nanoseconds, values = read.series(entity, "Scalars:scalars")
    gap = np.isnan(values).all(axis=1)
    assert gap.sum() == 1
    for column, name in enumerate(("measured", "nominal", "calibrated", "extended")):
        expected = np.concatenate([getattr(p, name)[0] for p in diagnosis.predictions])
        np.testing.assert_array_equal(values[~gap, column], expected)
    # Whole nanoseconds.
    np.testing.assert_allclose(nanoseconds[~gap] / 1e9, np.arange(2400) / RATE, atol=1e-9)
    assert read.static(entity, "SeriesLines:names") == ["measured", "as given", "calibrated", "extended"]
    (left,) = (name for name in read.entities if name.startswith("/residuals") and "acc0" in name)
    _, values = read.series(left, "Scalars:scalars")
    p = diagnosis.predictions[0]
    np.testing.assert_array_equal(values[:1200, 1], (p.measured - p.calibrated)[0])


def test_the_viewer_reads_the_verdict(read):
    (text,) = read.static("/summary", "TextDocument:text")
    assert "Explained: one thing is wrong with the model" in text
    assert "cubic stiffness" in text


def test_the_close_up_is_no_envelope(diagnosis, recording, tmp_path):
    """Of a record too long to be drawn whole, the stretch that opens has every sample."""
    n = 20_000
    u, *y = np.random.default_rng(0).standard_normal((3, 1, n))
    y = np.concatenate(y)
    off = y + 0.1
    off[:, 15_000:15_100] += 3.0  # the calibrated model errs most here
    long = replace(recording, records=(replace(recording.records[0], inputs=u, outputs=y),))
    wrong = replace(diagnosis, predictions=(Prediction(y, off, off, y, 14_000),))
    write_diagnosis_rrd(tmp_path / "run.rrd", wrong, long)
    read = Read(tmp_path / "run.rrd")
    (entity,) = (name for name in read.entities if name.startswith("/predictions") and "acc0" in name)
    nanoseconds, values = read.series(entity, "Scalars:scalars")
    assert values.shape[0] < n / 2
    at = np.round(nanoseconds / 1e9 * RATE, 6)
    within = (at >= 14_800) & (at < 15_300)
    np.testing.assert_array_equal(at[within], np.arange(14_800, 15_300))
    np.testing.assert_array_equal(values[within, 0], y[0, 14_800:15_300])


def test_the_finding_is_marked_in_both_structures(read, diagnosis):
    """An arc from end to end of the spring: it begins at one mass and ends at the other, in every frame."""
    for name in ("nominal", "extended"):
        entity = f"/structure/{name}/findings/0"
        _, arc = read.series(entity, "LineStrips3D:strips")
        for end, body in ((0, "mass0"), (-1, "mass1")):
            _, place = read.series(f"/structure/{name}/bodies/{body}", "Transform3D:translation")
            # Single precision of metres; a spring is drawn from centre to centre.
            np.testing.assert_allclose(arc[:, 0, end], place[:, 0], atol=1e-5)
        text = read.static(f"{entity}/label", "Points3D:labels")
        assert text == ["cubic stiffness"]


def test_causes_are_ranked_by_evidence(read):
    bars = np.array(read.static("/causes", "LineStrips2D:strips"))
    length = bars[:, 1, 0]
    assert length[0] > length[1] > length[2]
    # As long as the logarithm of the evidence: 1234.5 and 800.25.
    assert length[1] / length[0] == pytest.approx(math.log10(801.25) / math.log10(1235.5), rel=1e-6)
    texts = read.static("/causes/names", "Points2D:labels")
    assert texts[0] == "found: cubic stiffness at spring0_1, 1234"
    assert texts[1] == "instead of the first: bilinear stiffness at spring0_1, 800.2"


def test_spectra_are_laid_out_too(diagnosis, recording, tmp_path):
    """A diagnosis of spectra: the words, the ranked causes, and a plot for each row in decibels."""
    f = np.linspace(0.5, 25.0, 50)
    measured = np.stack([np.full(50, 1e-2), np.full(50, 1e-4)])
    rows = SpectralPrediction(
        f, measured, 10 * measured, measured, measured, ("acc0.x", "pos1"), ("(m/s^2)^2/Hz", "m^2/Hz")
    )
    write_diagnosis_rrd(tmp_path / "run.rrd", replace(diagnosis, spectra=rows), recording)
    read = Read(tmp_path / "run.rrd")
    views = read.views()
    assert [origin for _, origin in views if origin not in read.entities] == []
    assert sorted(kind for kind, _ in views) == ["2D", "2D", "2D", "TextDocument"]
    (entity,) = (e for e in read.entities if e.startswith("/spectra/acc0") and e.endswith("curves/1"))
    as_given = np.array(read.static(entity, "LineStrips2D:strips")[0])
    (entity,) = (e for e in read.entities if e.startswith("/spectra/acc0") and e.endswith("curves/0"))
    drawn = np.array(read.static(entity, "LineStrips2D:strips")[0])
    # Ten times the power is 10 dB, of a frame 80 high over the 30 dB around -20 and -10 dB.
    low, high = level_range([np.array([-20.0, -10.0])])
    np.testing.assert_allclose(drawn[:, 1] - as_given[:, 1], 80 * 10 / (high - low), rtol=1e-5)
