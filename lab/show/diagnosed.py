"""What a diagnosis was held against, in words: a recording, or frequency responses."""

from __future__ import annotations

from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.diagnosis.outcome import Diagnosis
from lab.show.recorded import recorded
from lab.show.verdict import counted

Diagnosed = Recording | FrequencyResponse


def title_of(diagnosis: Diagnosis, data: Diagnosed) -> str:
    """What report and viewer call a diagnosis."""
    own = data.title if isinstance(data, Recording) else ""
    return f"{own or diagnosis.nominal.name}: diagnosis"


def about(diagnosis: Diagnosis, data: Diagnosed) -> str:
    """One sentence on the model and the data."""
    rig = diagnosis.nominal
    size = f"{counted(len(rig.dofs), 'degree of freedom', 'degrees of freedom')}, {counted(len(rig.springs), 'spring')}"
    model = f"Model {rig.name} ({size}) held against"
    return f"{model} {recorded(data)}."
