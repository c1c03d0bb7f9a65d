"""Row: one question to one rig, what is known, and what the lab answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import lab
from identification.recording import Recording
from lab.effects.effect import EVERYWHERE
from lab.files.importing import Imported, read_foreign
from lab.files.recipe import load_recipe

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
RIGS = ROOT / "examples" / "rigs"


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        rig, question, known, says: in words.
        parameter: with its error bar.
        gain: on data kept aside.
        remark: where it is wrong or undecided, and why.
    """

    rig: str
    question: str
    known: str
    says: str
    parameter: str = ""
    gain: str = ""
    remark: str = ""

    def markdown(self) -> str:
        """The line."""
        cells = (self.rig, self.question, self.known, self.says, self.parameter, self.gain, self.remark)
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def imported(place: str, recipe: str) -> Imported:
    """What lies at a place among the data, read by a recipe."""
    return read_foreign(DATA / place, load_recipe(RIGS / recipe))


def measured(place: str, recipe: str) -> Recording:
    """The recording at a place among the data, read by a recipe."""
    recording = imported(place, recipe).recording
    assert recording is not None
    return recording


def told(
    rig: str,
    question: str,
    known: str,
    diagnosis: lab.Diagnosis,
    *,
    show: Sequence[str] = (),
    remark: str = "",
) -> Row:
    """The row of a diagnosis: verdict, causes, parameters, and the error on data kept aside.

    Args:
        rig, question, known: in words.
        diagnosis: what the lab says.
        show: calibrated parameters to tell besides those of the findings.
        remark: where it is wrong or undecided, and why.
    """
    named = [_placed(f.effect.cause, f.effect.location) for f in diagnosis.findings]
    rivals = [_placed(a.cause, a.location) for a in diagnosis.alternatives if a.advice]
    says = f"{diagnosis.verdict}{': ' if named else ''}{', '.join(named)}"
    if rivals:
        says += f"; not separable from the first: {', '.join(rivals)}"
    sizes = [
        f"{name} = {q.value:.3g} ± {q.std:.1g}{'' if q.unit == '1' else ' ' + q.unit}"
        for f in diagnosis.findings
        for name, q in f.parameters.items()
    ]
    sizes += [f"{name} = {(c := diagnosis.calibration[name]).value:.4g} ± {c.std:.1g}" for name in show]
    errors = diagnosis.errors
    gain = f"error {errors.calibrated:.3g} → {errors.extended:.3g}, noise {errors.noise_floor:.2g}"
    if diagnosis.findings:
        gain += "; gain " + ", ".join(f"{f.holdout_gain:.2f}" for f in diagnosis.findings)
    return Row(rig, question, known, says, "; ".join(sizes), gain, remark)


def _placed(cause: str, location: str) -> str:
    return f"`{cause}` everywhere" if location == EVERYWHERE else f"`{cause}` at {location}"
