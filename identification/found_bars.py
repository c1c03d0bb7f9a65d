"""Error bars of what a method found, and what to say of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError
from identification.found import Found
from identification.modes import Modes
from identification.observer_scatter import observer_scatter
from identification.progress import UNHEARD, Work
from identification.spectral_scatter import SPECTRAL, ModeErrorBars, spectral_scatter
from identification.systems import SecondOrder
from identification.uncertainty import matrices_with_error_bars, modes_with_error_bars

TOLD = 0.5
"""Share of an error bar from which on a shift is told of; 24 draws know it to a fifth."""


def error_bars(
    found: Found, matrices: SecondOrder | None, *, work: Work = UNHEARD
) -> tuple[Modes, SecondOrder | None, tuple[str, ...]]:
    """Modes and matrices with their standard deviations, or the reasons why they have none.

    Args:
        found: modes and models.
        matrices: those found, or None; standard deviations that they have already stay.
        work: told how much of this is done, where that is known.

    Returns:
        Modes, matrices, and sentences on their error bars.

    Source: as for `modes_with_error_bars`, `observer_scatter` and `matrices_with_error_bars`.
    """
    wanting = matrices if matrices is not None and matrices.mass_std is None else None
    if found.realization.method == "okid_era" and len(found.modes):  # one redraw of the noise serves both
        try:
            bars, with_bars = observer_scatter(
                found.recording, found.realization, found.modes, matrices=wanting, work=work
            )
        except IdentificationError as error:
            return found.modes, matrices, (f"Modes and matrices have no error bars: {error}.",)
        return _with(found.modes, bars), with_bars or matrices, told_shift(found.modes, bars)
    modes = found.modes
    notes: list[str] = []
    try:
        modes, shifts = _of_modes(found, work)
        notes += shifts
    except IdentificationError as error:
        notes.append(f"The modes have no error bars: {error}.")
    if wanting is not None:
        try:
            matrices = matrices_with_error_bars(found.recording, found.realization, wanting)
        except IdentificationError as error:
            notes.append(f"Mass, damping and stiffness have no error bars: {error}.")
    return modes, matrices, tuple(notes)


def _of_modes(found: Found, work: Work) -> tuple[Modes, tuple[str, ...]]:
    """Modes with error bars, and what noise shifts in them."""
    given = found.settings
    if found.realization.method not in SPECTRAL:
        return modes_with_error_bars(
            found.recording, found.realization, found.modes, places=found.places, settings=given
        ), ()
    if not len(found.modes):
        return found.modes, ()
    bars = spectral_scatter(found.recording, found.realization, found.tracks(), settings=given, work=work)
    return _with(found.modes, bars), told_shift(found.modes, bars)


def _with(modes: Modes, bars: ModeErrorBars) -> Modes:
    return replace(modes, frequency_std=bars.frequency, damping_std=bars.damping)


def told_shift(modes: Modes, bars: ModeErrorBars) -> tuple[str, ...]:
    """One sentence where noise shifts a damping ratio by more than a share `TOLD` of its error bar, or none.

    Args:
        modes: those found.
        bars: their error bars.

    Returns:
        At most one sentence, on the mode of which it is most true.
    """
    known = np.isfinite(bars.damping_shift) & np.isfinite(bars.damping) & (bars.damping > 0)
    share = np.where(known, np.abs(bars.damping_shift), 0) / np.where(known, bars.damping, 1)
    if not share.size or np.max(share) < TOLD:
        return ()
    k = int(np.argmax(share))
    return (
        f"Noise shifts the damping ratios with this method, that of the mode at {modes.frequency_hz[k]:.4g} Hz by about "
        f"{bars.damping_shift[k]:+.2g}; the error bars count it, and a refinement is nearly free of it.",
    )
