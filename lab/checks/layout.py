"""Channels in another order or with another sign than the model's, by the shapes of the modes.

The best arrangement of all is held against the order in which the channels are named.
"""

from __future__ import annotations

import numpy as np

from lab.checks.arrangement import Arrangement, balanced, best_arrangement, mean_mac, next_best
from lab.checks.pairs import FITS, Pairs
from lab.checks.remark import Remark
from lab.checks.survey import Survey

BETTER = 0.08
"""Gain of mean MAC by which another layout must win."""

FIRM = 0.3
"""Share of the misfit by which the next best layout must lie behind."""


def layout(survey: Survey) -> list[Remark]:
    """Outputs whose names or signs must change for the measured mode shapes to be the model's.

    Source: Allemang and Brown (1982), Proc. 1st IMAC, eq. (7), for the MAC; Kuhn (1955), Nav. Res. Logist. Q. 2,
        83-97, for the assignment.
    """
    pairs = survey.pairs
    if pairs is None or len(survey.recording.outputs) < 2 or pairs.measured.size < 2:
        return []
    named = mean_mac(pairs.measured_shapes, pairs.modelled_shapes)
    chosen = chosen_arrangement(pairs, same_units=survey.same_units)
    if chosen is None or chosen.as_named:
        return []
    names = [channel.name for channel in survey.recording.outputs]
    evidence = {"mac_as_named": named, "mac_reordered": chosen.agreement, "modes": float(pairs.measured.size)}
    stop = survey.recording.records[0].n_samples / survey.recording.sample_rate
    told = f"the mean MAC with the model is {named:.2f}, and {chosen.agreement:.2f} after this change"
    remarks = []
    moved = np.flatnonzero(chosen.order != np.arange(len(names)))
    if moved.size:
        says = ", ".join(f"{names[chosen.order[i]]} is {names[i]}" for i in moved)
        remarks.append(
            Remark(
                "order",
                "|".join(names[i] for i in moved),
                "fault",
                f"the channels are in another order than the model's: {says} ({told})",
                "check the cables and the table of channels, or rename them with --map",
                0,
                0.0,
                stop,
                evidence,
            )
        )
    for row, sign in zip(chosen.order, chosen.signs, strict=True):
        if sign < 0:
            remarks.append(
                Remark(
                    "sign",
                    names[row],
                    "fault",
                    f"has its sign flipped against the other outputs ({told})",
                    "check how the sensor is mounted, and change the sign of its factor",
                    0,
                    0.0,
                    stop,
                    evidence,
                )
            )
    return remarks


def chosen_arrangement(pairs: Pairs, *, same_units: bool) -> Arrangement | None:
    """The simplest arrangement under which the shapes agree; None when none does, or several do.

    First the channels as named, then another order or sign, then either of them with a factor of each channel left
    free.
    """
    measured, modelled = pairs.measured_shapes, pairs.modelled_shapes
    n, n_modes = measured.shape
    for phi, psi in ((measured, modelled), (balanced(measured), balanced(modelled))):
        if phi is measured and not same_units:
            continue
        named = Arrangement(np.arange(n), np.ones(n), mean_mac(phi, psi))
        best = best_arrangement(phi, psi)
        if named.agreement > FITS and best.agreement < named.agreement + BETTER:
            return named
        firm = 1 - next_best(best, phi, psi) > (1 + FIRM) * (1 - best.agreement)
        if best.agreement > FITS and best.agreement > named.agreement + BETTER and firm:
            return best
        if n_modes < 3:
            break  # a factor of each channel leaves two shapes nothing to tell
    return None
