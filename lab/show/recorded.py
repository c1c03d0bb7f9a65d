"""What was recorded, in words."""

from __future__ import annotations

from identification.recording import Recording
from identification.response import FrequencyResponse
from lab.show.signals import measured_inputs
from lab.show.verdict import counted


def recorded(recording: Recording | FrequencyResponse) -> str:
    """Records, channels, length and rate, or channels and lines of frequency responses, as the end of a sentence."""
    if isinstance(recording, FrequencyResponse):
        f = recording.frequency_hz
        return (
            f"the frequency responses of {counted(len(recording.outputs), 'output')} to "
            f"{counted(len(recording.inputs), 'input')}, "
            f"{f.size} lines from {f[0]:g} to {f[-1]:g} Hz"
        )
    kinds = ", ".join(sorted({record.kind.replace("_", " ") for record in recording.records}))
    return (
        f"{counted(len(recording.records), 'record')} ({kinds}) with "
        f"{counted(len(measured_inputs(recording)), 'input')} and {counted(len(recording.outputs), 'output')}, "
        f"{recording.duration:g} s at {recording.sample_rate:g} Hz"
    )
