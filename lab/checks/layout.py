"""Channels in another order or with another sign than the model's, by the shapes of the modes.

The rows of two matrices of mode shapes, measured Φ and modelled Ψ, shape (n_outputs, n_modes), belong together up to an
order and signs of the channels, and a sign of each mode. For every choice of the modes' signs the best order is an
assignment problem; the best of all is held against the order in which the channels are named.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from identification.recording import Array
from lab.checks.pairs import Pairs
from lab.checks.remark import Remark
from lab.checks.survey import Survey

FITS = 0.85
"""Mean MAC at which shapes agree, although the model is only nominal."""

BETTER = 0.08
"""Gain of mean MAC by which another layout must win."""

FIRM = 0.3
"""Share of the misfit by which the next best layout must lie behind."""


@dataclass(frozen=True)
class Layout:
    """Which measured channel belongs where.

    Attributes:
        order: measured row at each of the model's rows.
        signs: of those rows.
        agreement: mean MAC over the modes after reordering.
    """

    order: NDArray[np.int64]
    signs: Array
    agreement: float

    @property
    def as_named(self) -> bool:
        """Whether order and signs are those of the channels' names."""
        return bool(np.all(self.order == np.arange(self.order.size)) and np.all(self.signs == 1))


def layout(survey: Survey) -> list[Remark]:
    """Outputs whose names or signs must change for the measured mode shapes to be the model's.

    Source: Allemang and Brown (1982), Proc. 1st IMAC, eq. (7), for the MAC; Kuhn (1955), Nav. Res. Logist. Q. 2,
        83-97, for the assignment.
    """
    pairs = survey.pairs
    if pairs is None or len(survey.recording.outputs) < 2 or pairs.measured.size < 2:
        return []
    named = mean_mac(pairs.measured_shapes, pairs.modelled_shapes)
    chosen = chosen_layout(pairs, same_units=survey.same_units)
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


def mean_mac(a: Array, b: Array) -> float:
    """Mean MAC of real shapes, column by column."""
    overlap = np.sum(a * b, axis=0) ** 2
    return float(np.mean(overlap / (np.sum(a**2, axis=0) * np.sum(b**2, axis=0))))


def chosen_layout(pairs: Pairs, *, same_units: bool) -> Layout | None:
    """The simplest layout under which the shapes agree; None when none does, or several do.

    First the channels as named, then another order or sign, then either of them with a factor of each channel left
    free.
    """
    measured, modelled = pairs.measured_shapes, pairs.modelled_shapes
    n = len(measured)
    found = None
    for phi, psi in ((measured, modelled), (balanced(measured), balanced(modelled))):
        if phi is measured and not same_units:
            continue
        named = Layout(np.arange(n), np.ones(n), mean_mac(phi, psi))
        best, second = best_layouts(phi, psi)
        if named.agreement > FITS and best.agreement < named.agreement + BETTER:
            return named
        firm = 1 - second > (1 + FIRM) * (1 - best.agreement)
        if best.agreement > FITS and best.agreement > named.agreement + BETTER and firm:
            return best
        if pairs.measured.size < 3:
            break  # a factor of each channel leaves two shapes nothing to tell
    return found


def best_layouts(phi: Array, psi: Array) -> tuple[Layout, float]:
    """The best layout, and the agreement of the next best.

    The next best differs in one sign or in two channels exchanged.
    """
    phi, psi = phi / np.linalg.norm(phi, axis=0), psi / np.linalg.norm(psi, axis=0)
    best: Layout | None = None
    for flips in itertools.product((1.0, -1.0), repeat=phi.shape[1] - 1):
        turned = psi * np.array([1.0, *flips])
        overlap = turned @ phi.T  # (rows of the model, measured rows)
        rows, order = scipy.optimize.linear_sum_assignment(-np.abs(overlap))
        signs = np.where(overlap[rows, order] < 0, -1.0, 1.0)
        value = mean_mac(phi[order] * signs[:, None], psi)
        if best is None or value > best.agreement + 1e-12:
            best = Layout(order, signs, value)
    assert best is not None
    if np.sum(best.signs < 0) > np.sum(best.signs > 0) or (np.sum(best.signs) == 0 and best.signs[0] < 0):
        # All signs at once are the signs of the modes, which mean nothing.
        best = Layout(best.order, -best.signs, best.agreement)
    arranged = phi[best.order] * best.signs[:, None]
    return best, max(mean_mac(arranged, other) for other in _neighbours(psi))


def _neighbours(psi: Array) -> list[Array]:
    """The shapes with one sign changed or two rows exchanged."""
    n = len(psi)
    found = []
    for i in range(n if n > 2 else 1):
        flipped = psi.copy()
        flipped[i] *= -1
        found.append(flipped)
    for i, j in itertools.combinations(range(n), 2):
        swapped = psi.copy()
        swapped[[i, j]] = swapped[[j, i]]
        found.append(swapped)
    return found


def balanced(shapes: Array) -> Array:
    """Shapes scaled row by row and column by column to equal mean squares, which takes all factors out.

    Source: Sinkhorn (1964), Ann. Math. Stat. 35, 876-879.
    """
    x = shapes.copy()
    for _ in range(100):
        x /= np.maximum(np.sqrt(np.mean(x**2, axis=1, keepdims=True)), 1e-300)
        x /= np.maximum(np.sqrt(np.mean(x**2, axis=0, keepdims=True)), 1e-300)
    return x
