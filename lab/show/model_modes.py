"""What the findings mean for the modes: those of the model as given beside those of the extended one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError
from identification.modes import Modes
from lab.compare import compare
from lab.diagnosis.outcome import Diagnosis
from lab.errors import LabError
from lab.show.findings import Table
from lab.validation import Limits

BAND = 0.5
"""Modes further apart than this relative frequency are no pair."""
HEADS = (
    "Mode",
    "As given [Hz]",
    "Extended [Hz]",
    "Change",
    "As given [%]",
    "Extended [%]",
    "MAC",
    "Criteria",
)


def mode_changes(diagnosis: Diagnosis) -> Table:
    """Frequency, damping and shape of every mode in both models, and whether the model as given keeps the usual limits.

    No rows where a model has no modes about its rest.
    """
    try:
        given, extended = (rig.second_order().modes() for rig in (diagnosis.nominal, diagnosis.extended))
    except (LabError, IdentificationError):
        return Table(HEADS, ())
    common = [c.name for c in given.outputs if c.name in {other.name for other in extended.outputs}]
    given, extended = _at(given, common), _at(extended, common)
    if not common or not len(given) or not len(extended):
        return Table(HEADS, ())
    comparison = compare(extended, given, frequency_band=BAND)
    partner = {pair.truth: pair for pair in comparison.pairs}
    limits, rows = Limits(), []
    for k in range(len(extended)):
        pair = partner.get(k)
        own = f"{extended.frequency_hz[k]:.5g}", f"{100 * extended.damping_ratio[k]:.3g}"
        if pair is None:
            rows.append((str(k + 1), "none", own[0], "", "", own[1], "", "new"))
            continue
        f, z = given.frequency_hz[pair.estimate], given.damping_ratio[pair.estimate]
        bound = limits.first_frequency_error if k == 0 else limits.frequency_error
        kept = abs(pair.frequency_error) <= bound and pair.mac >= limits.mac
        change = f"{100 * (extended.frequency_hz[k] / f - 1):+.2g} %" if f else "undefined"
        rows.append(
            (
                str(k + 1),
                f"{f:.5g}",
                own[0],
                change,
                f"{100 * z:.3g}",
                own[1],
                f"{math.floor(1e4 * pair.mac + 1e-8) / 1e4:.4f}",  # never rounded up
                "within" if kept else "BEYOND",
            )
        )
    return Table(HEADS, tuple(rows))


def _at(modes: Modes, names: list[str]) -> Modes:
    """The same modes at some of their points."""
    position = {channel.name: row for row, channel in enumerate(modes.outputs)}
    rows = np.array([position[name] for name in names], dtype=int)
    return replace(modes, shapes=modes.shapes[rows], outputs=tuple(modes.outputs[row] for row in rows))
