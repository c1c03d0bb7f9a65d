"""Checks: what an experienced technician notices in a recording before any analysis.

`check(recording)` looks at the recording alone, `check(recording, rig)` also holds it against a model. Each check is a
function of a survey, in a file of its own, and returns remarks; together they look through the data about five times.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from identification.progress import Progress, Work
from identification.recording import Recording
from lab.checks.clipping import clipping
from lab.checks.coherence import coherence
from lab.checks.dead import dead
from lab.checks.drift import drift
from lab.checks.dropouts import dropouts
from lab.checks.excitation import excitation
from lab.checks.fitting import fitted, fitting
from lab.checks.hum import hum
from lab.checks.jumps import jumps
from lab.checks.layout import layout
from lab.checks.missing import missing
from lab.checks.quantization import quantization
from lab.checks.rate import rate
from lab.checks.remark import SEVERITIES, Remark
from lab.checks.saturation import saturation
from lab.checks.scale import scale
from lab.checks.spikes import spikes
from lab.checks.survey import Survey
from lab.checks.twins import twins
from lab.checks.units import units
from lab.rig import Rig

__all__ = ["CHECKS", "Remark", "check"]

CHECKS: dict[str, Callable[[Survey], list[Remark]]] = {
    "fitting": fitting,
    "missing": missing,
    "dead": dead,
    "twins": twins,
    "layout": layout,
    "scale": scale,
    "rate": rate,
    "units": units,
    "clipping": clipping,
    "saturation": saturation,
    "jumps": jumps,
    "dropouts": dropouts,
    "spikes": spikes,
    "drift": drift,
    "hum": hum,
    "quantization": quantization,
    "coherence": coherence,
    "excitation": excitation,
}
"""One file each; the first eight in the order in which mistakes of wiring and tables hide one another."""


def check(recording: Recording, rig: Rig | None = None, *, progress: Progress | None = None) -> list[Remark]:
    """Remarks on a recording, the most serious first.

    Args:
        recording: of any kind and length; read piece by piece, in about four passes.
        rig: the model that it is meant to fit; its channels are found by name.
        progress: told what is being done, and the share of it that is done.

    Returns:
        One remark for each check and channel; one that shows in several records tells the first.

    Raises:
        UnknownNameError: the model lacks a channel of the recording.
    """
    work = Work(progress).called("checking")
    survey = Survey(recording, None if rig is None else fitted(rig, recording))
    found = [
        remark for function in work.each(CHECKS.values(), len(CHECKS)) for remark in _once(function(survey))
    ]
    return sorted(found, key=lambda remark: SEVERITIES.index(remark.severity))


def _once(remarks: list[Remark]) -> list[Remark]:
    """The first remark of each check on each channel, with the number of records in which it shows."""
    groups: dict[tuple[str, str], list[Remark]] = {}
    for remark in remarks:
        groups.setdefault((remark.check, remark.channel), []).append(remark)
    merged = []
    for each in groups.values():
        records = {remark.record for remark in each}
        first = each[0]
        if len(records) > 1:
            first = replace(first, evidence={**first.evidence, "records": len(records)})
        merged += [first] if len(records) > 1 else each
    return merged
