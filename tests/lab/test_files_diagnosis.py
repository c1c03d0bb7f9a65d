"""diagnosis.json: the keys that others rely on, the values unchanged, and one line for a file that is none."""

import json
import math
from dataclasses import replace

import pytest

from lab.diagnosis.outcome import Calibrated, Errors
from lab.errors import FileError
from lab.files.diagnosis import diagnosis_document, load_diagnosis, save_diagnosis
from tests.lab.diagnosed import explained, recorded, two_masses


@pytest.fixture(scope="module")
def diagnosis():
    rig = two_masses()
    return explained(rig, recorded(rig, n_records=1))


def test_the_document_is_the_agreed_one(diagnosis, tmp_path):
    save_diagnosis(diagnosis, tmp_path / "diagnosis.json")
    says = "The spring spring0_1 hardens with the cube of its extension."
    assert load_diagnosis(tmp_path / "diagnosis.json") == {
        "format": "modal-diagnosis",
        "version": 1,
        "verdict": "explained",
        "findings": [
            {
                "cause": "cubic_stiffness",
                "location": "spring0_1",
                "parameters": {"k3": {"value": 5e6, "std": 4e4, "unit": "N/m^3"}},
                "log_evidence_gain": 1234.5,
                "holdout_gain": 0.99,
                "says": says,
            }
        ],
        "alternatives": [
            {
                "cause": "bilinear_stiffness",
                "location": "spring0_1",
                "log_evidence_gain": 800.25,
                "advice": "",
            },
            {
                "cause": "gap_contact",
                "location": "spring0_1",
                "log_evidence_gain": -3.0,
                "advice": "A stronger push would tell a stop from a cubic.",
            },
        ],
        "calibration": {
            "mass mass0": {"nominal": 1.0, "value": 1.002, "std": 0.001},
            "stiffness spring0_1": {"nominal": 900.0, "value": 884.0, "std": 2.0},
        },
        "fit": {"noise_floor": 0.01, "nominal": 0.3, "calibrated": 0.08, "extended": 0.0102},
        "noise": {"acc0.x": {"value": 0.02, "std": 0.001, "unit": "m/s^2"}},
        "unlearnable": ["One shaker cannot tell its gain from a common scale of masses and stiffnesses."],
        "warnings": ["Too short."],
    }
    assert [path.name for path in tmp_path.iterdir()] == ["diagnosis.json"]


def test_what_is_not_finite_is_null(diagnosis, tmp_path):
    endless = replace(
        diagnosis,
        calibration={"mass mass0": Calibrated(1.0, 1.0, math.inf)},
        errors=Errors(0.01, math.nan, 0.08, 0.01),
    )
    save_diagnosis(endless, tmp_path / "diagnosis.json")

    def refuse(constant):
        raise AssertionError(constant)

    document = json.loads((tmp_path / "diagnosis.json").read_text("utf-8"), parse_constant=refuse)
    assert document["fit"]["nominal"] is None
    assert document["calibration"]["mass mass0"]["std"] is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "cannot be read"),
        ("{", "is not JSON"),
        ("[]", "expected 'modal-diagnosis' version 1"),
        ('{"format": "modal-result", "version": 1}', "is of format 'modal-result' version 1"),
        ('{"format": "modal-diagnosis", "version": 2}', "version 2; expected 'modal-diagnosis' version 1"),
        ('{"format": "modal-diagnosis", "version": 1}', "has no 'verdict'"),
    ],
)
def test_a_file_that_is_no_diagnosis_is_one_line(tmp_path, text, says):
    path = tmp_path / "diagnosis.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(FileError, match=r"diagnosis\.json") as failed:
        load_diagnosis(path)
    assert says in str(failed.value)
    assert "\n" not in str(failed.value)


def test_a_verdict_that_does_not_exist_is_refused(diagnosis, tmp_path):
    save_diagnosis(replace(diagnosis, verdict="perhaps"), tmp_path / "diagnosis.json")
    with pytest.raises(FileError, match="'perhaps'; expected one of consistent, explained, unexplained"):
        load_diagnosis(tmp_path / "diagnosis.json")


def test_a_place_that_cannot_be_written(diagnosis, tmp_path):
    with pytest.raises(FileError, match="cannot be written"):
        save_diagnosis(diagnosis, tmp_path / "nowhere" / "diagnosis.json")


def test_the_document_is_plain(diagnosis):
    def walk(value):
        assert type(value) in (dict, list, str, float, int, bool, type(None))
        for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
            walk(item)

    walk(diagnosis_document(diagnosis))
