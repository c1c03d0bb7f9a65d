"""What was recorded, in words."""

from __future__ import annotations

from identification.recording import Recording
from lab.show.signals import measured_inputs
from lab.show.verdict import counted


def recorded(recording: Recording) -> str:
    """Records, channels, length and rate, as the end of a sentence."""
    kinds = ", ".join(sorted({record.kind.replace("_", " ") for record in recording.records}))
    return (
        f"{counted(len(recording.records), 'record')} ({kinds}) with "
        f"{counted(len(measured_inputs(recording)), 'input')} and {counted(len(recording.outputs), 'output')}, "
        f"{recording.duration:g} s at {recording.sample_rate:g} Hz"
    )
