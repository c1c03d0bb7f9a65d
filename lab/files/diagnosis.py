"""Diagnosis -> diagnosis.json, plain enough for any language to read."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from lab.diagnosis.outcome import CONSISTENT, EXPLAINED, UNEXPLAINED, Diagnosis
from lab.errors import FileError
from lab.files.document import plain, read_document, write_document

FORMAT = "modal-diagnosis"
VERSION = 1
VERDICTS = (CONSISTENT, EXPLAINED, UNEXPLAINED)
KEYS = ("verdict", "findings", "alternatives", "calibration", "fit", "warnings")


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """What `diagnosis.json` says, as plain lists, numbers and texts; None for a number that is not finite.

    `advice`, `noise` and `unlearnable` may be absent from files of other writers; a reader must not ask for them.
    """
    document = {
        "format": FORMAT,
        "version": VERSION,
        "verdict": diagnosis.verdict,
        "findings": [
            {
                "cause": finding.effect.cause,
                "location": finding.effect.location,
                "parameters": {name: asdict(quantity) for name, quantity in finding.parameters.items()},
                "log_evidence_gain": finding.log_evidence_gain,
                "holdout_gain": finding.holdout_gain,
                "says": finding.says,
            }
            for finding in diagnosis.findings
        ],
        "alternatives": [
            {
                "cause": other.cause,
                "location": other.location,
                "log_evidence_gain": other.log_evidence_gain,
                "advice": other.advice,
            }
            for other in diagnosis.alternatives
        ],
        "calibration": {name: asdict(parameter) for name, parameter in diagnosis.calibration.items()},
        "fit": asdict(diagnosis.errors),
        "noise": {name: asdict(quantity) for name, quantity in diagnosis.noise.items()},
        "unlearnable": list(diagnosis.unlearnable),
        "warnings": list(diagnosis.warnings),
    }
    return dict(plain(document))


def save_diagnosis(diagnosis: Diagnosis, path: str | Path) -> None:
    """Writes `diagnosis.json`; an existing file is replaced once the new one is whole.

    Raises:
        FileError: the file cannot be written.
    """
    write_document(diagnosis_document(diagnosis), path)


def load_diagnosis(path: str | Path) -> dict[str, Any]:
    """The document in a `diagnosis.json`, checked for format, version and main keys.

    Raises:
        FileError: no such file, not JSON, of another format or version, or incomplete.
    """
    document = read_document(path, form=FORMAT, version=VERSION, keys=KEYS)
    if document["verdict"] not in VERDICTS:
        raise FileError(f"{path}: verdict is {document['verdict']!r}; expected one of {', '.join(VERDICTS)}")
    return document
