"""What a diagnosis was held against, in words: a recording, or frequency responses."""

from __future__ import annotations

from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.diagnosis.outcome import Diagnosis
from lab.show.signals import measured_inputs

Diagnosed = Recording | FrequencyResponse


def title_of(diagnosis: Diagnosis, data: Diagnosed) -> str:
    """What report and viewer call a diagnosis."""
    own = data.title if isinstance(data, Recording) else ""
    return f"{own or diagnosis.nominal.name}: diagnosis"


def about(diagnosis: Diagnosis, data: Diagnosed) -> str:
    """One sentence on the model and the data."""
    rig = diagnosis.nominal
    model = f"Model {rig.name} ({len(rig.dofs)} degrees of freedom, {len(rig.springs)} springs) held against"
    if isinstance(data, FrequencyResponse):
        f = data.frequency_hz
        return (
            f"{model} the frequency responses of {len(data.outputs)} outputs to {len(data.inputs)} inputs, "
            f"{f.size} lines from {f[0]:g} to {f[-1]:g} Hz."
        )
    n = len(data.records)
    kinds = ", ".join(sorted({record.kind.replace("_", " ") for record in data.records}))
    return (
        f"{model} {n} record{'s' if n > 1 else ''} ({kinds}) with {len(measured_inputs(data))} inputs and "
        f"{len(data.outputs)} outputs, {data.duration:g} s at {data.sample_rate:g} Hz."
    )
