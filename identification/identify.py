"""From a recording to its modes, and to mass, damping and stiffness where the set-up allows: all on one page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification.clusters import Poles, Thresholds, difference
from identification.errors import IdentificationError, RecordingError
from identification.explanation import explanation
from identification.found import Found, matrices_of
from identification.found_bars import error_bars
from identification.markov_methods import MARKOV_METHODS
from identification.methods import find_method
from identification.modes import Modes
from identification.output_only import horizon_warning
from identification.progress import Progress, Work
from identification.recording import Recording
from identification.refinement import Refinement, refinement
from identification.settled import NESTED, brief_warnings, settle
from identification.stability import Stabilization, stabilize
from identification.systems import Realization, SecondOrder
from identification.uncertainty import Placed

REDRAWS = 12.0
"""Cost of error bars, in that of the estimates, as measured with `okid_era`."""
HANKEL = (*NESTED, *(name for name in MARKOV_METHODS if name != "era_dc"))
"""Methods whose horizon is the block rows and columns of one Hankel matrix."""


@dataclass(frozen=True, eq=False)
class Identification:
    """What a recording tells about its structure.

    Attributes:
        realization: models of all orders; its `order` is the one asked for, the one that the data show, or
            the lowest by which all modes have settled.
        stabilization: every pole of every order and its verdict; None when there is one order only.
        modes: sorted by frequency.
        stable: whether each mode stayed put over the orders, or decays where there is one order only.
        second_order: M, C_d and K, or None where the channels or the data do not determine them.
        notes: what was chosen and why, one sentence each.
        warnings: what a careful reader should know, one sentence each.
        explanation: one paragraph on the method, order and horizon chosen, and on what was kept and rejected.
        refinement: the maximum of the likelihood that modes and matrices were moved to; None where not asked for.
    """

    realization: Realization
    stabilization: Stabilization | None
    modes: Modes
    stable: tuple[bool, ...]
    second_order: SecondOrder | None
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    explanation: str = ""
    refinement: Refinement | None = None


def identify(
    recording: Recording,
    method: str | None = None,
    *,
    order: int | None = None,
    dofs: Sequence[str] | None = None,
    uncertainty: bool = True,
    refine: bool = False,
    progress: Progress | None = None,
    **settings: Any,
) -> Identification:
    """Modes of the structure behind a recording, and M, C and K where its channels allow.

    Args:
        recording: complete, in SI units.
        method: name in `METHODS`; chosen from the kinds of the records when None.
        order: number of states; None sweeps the order and keeps the modes that stay put, or takes the rank of
            the data when they are free of noise.
        dofs: names of the degrees of freedom of M, C and K in the order wanted.
        uncertainty: whether to find the standard deviations of modes and matrices too, which costs up to about ten
            times as much as the estimates.
        refine: whether to move modes and matrices to the maximum of the likelihood, whatever method they come from;
            only with measured forces, or free decays. Their standard deviations are then those of the likelihood.
        progress: told what is being done, and how much of it is done.
        **settings: further settings of the method.

    Returns:
        Modes and matrices with standard deviations, the models behind them, and the reasons for every choice.

    Raises:
        RecordingError: a sample is missing, or forces that `refine` needs; tells the channel or record.
        IdentificationError: no such method or setting, or data that the method cannot use.

    Source: that of the method (`METHODS`); for M, C_d and K De Angelis et al. (2002), J. Appl. Mech. 69, eq. (18).
    """
    recording.require_complete()
    name, reason = (method, "as asked for") if method is not None else choose_method(recording)
    chosen = find_method(name)
    realizing, barring = Work(progress).parts(1.0, REDRAWS)
    realizing.called("identifying")
    realization = chosen(recording, order, **settings)
    notes = (f"The method is {name}, {reason}.", *realization.notes)
    stabilization = stabilize(realization) if len(realization.systems) > 1 else None
    brief: tuple[bool, ...] = ()
    if stabilization is None or chosen.finds_order or order is not None:
        modes, places = realization.system.modes().normalized(), None
        stable = _stays_put(modes, stabilization)
    elif name in NESTED and len(stabilization.modes):
        settled = settle(stabilization)
        modes, places = settled.modes, [Placed(*place) for place in settled.places]
        stable = (True,) * len(modes)
        realization = replace(realization, order=settled.order)
        notes, brief = (*notes, *settled.notes), settled.brief
    else:
        modes, places = stabilization.modes, first_settled(stabilization)
        stable = (True,) * len(modes)
        realization, note = _lowest_complete(realization, stabilization)
        notes += note
    barring = barring.called("refining" if refine else "finding error bars" if uncertainty else "finishing")
    found = Found(recording, realization, stabilization, modes, places, settings)
    matrices, verdict = matrices_of(found, dofs, uncertainty=uncertainty)
    refined, after, doubts = _refined(found, matrices) if refine else (None, (), ())
    if refined is not None:
        modes, matrices = refined.modes, refined.second_order
        stable = tuple(stable[k] for k in refined.partners)
    elif uncertainty:
        modes, matrices, missing = error_bars(found, matrices, work=barring)
        after += missing
    warnings = (
        *_order_warnings(realization, modes),
        *(brief_warnings(modes, brief) if brief and not refined else ()),
        *(horizon_warning(modes, realization) if name in HANKEL else ()),
        *(() if refined else _length_warnings(recording, realization, modes)),
        *doubts,
    )
    before, after = (
        tuple(note for note in each if note not in warnings) for each in (notes, (*verdict, *after))
    )
    return Identification(
        realization,
        stabilization,
        modes,
        stable,
        matrices,
        (*before, *after),
        warnings,
        explanation(before, stabilization, stable, after),
        refined,
    )


def choose_method(recording: Recording) -> tuple[str, str]:
    """Name of the method that suits the records, and the reason.

    Args:
        recording: of any kinds of records.

    Returns:
        A name in `METHODS`, and half a sentence.
    """
    kinds = {record.kind for record in recording.records}
    if kinds == {"pulse"}:
        return "era", "since the response to a unit pulse is what it realizes"
    if kinds == {"free_decay"}:
        return "era", "since a free decay is the response to a pulse but for its scale"
    if "ambient" in kinds or not all(record.inputs.shape[0] for record in recording.records):
        return "ssi_cov", "since forces act that were not measured"
    return "okid_era", "since the forces were measured, and known forces tell more than outputs alone"


def _stays_put(modes: Modes, stabilization: Stabilization | None) -> tuple[bool, ...]:
    """Whether each mode is among those that stay put over the orders, or decays where there is one order."""
    if stabilization is None:
        return tuple(bool(z >= 0) for z in modes.damping_ratio)
    if not len(stabilization.modes):
        return (False,) * len(modes)
    apart = difference(Poles.of(modes), Poles.of(stabilization.modes), Thresholds())
    same = (apart.frequency <= 1) & (apart.shape <= 1) & (apart.damping <= 1)
    return tuple(bool(found) for found in np.atleast_1d(np.any(same, axis=1)))


def _lowest_complete(
    realization: Realization, stabilization: Stabilization
) -> tuple[Realization, tuple[str, ...]]:
    """The realization with the lowest order at which every mode has a stable pole, as far as there is one."""
    n_modes = len(stabilization.modes)
    if not n_modes:
        return realization, ()
    first = [int(np.min(stabilization.orders[stabilization.cluster == k])) for k in range(n_modes)]
    order = max(first)
    return replace(realization, order=order), (
        f"Of {len(realization.orders)} orders, {order} is the first by which all {n_modes} modes have settled.",
    )


def first_settled(stabilization: Stabilization) -> list[Placed]:
    """Where each mode stands at the lowest order at which it has settled.

    At higher orders poles of the noise come close to it, and to first order nothing is known of their effect.

    Args:
        stabilization: poles of all orders, and their clusters.

    Returns:
        One place per mode.
    """
    places = []
    for k in range(len(stabilization.modes)):
        i = int(np.flatnonzero(stabilization.cluster == k)[0])
        omega, zeta = 2 * np.pi * stabilization.frequency_hz[i], stabilization.damping_ratio[i]
        places.append(
            Placed(int(stabilization.orders[i]), complex(omega * (-zeta + 1j * np.sqrt(1 - zeta**2))))
        )
    return places


def _refined(
    found: Found, matrices: SecondOrder | None
) -> tuple[Refinement | None, tuple[str, ...], tuple[str, ...]]:
    """The maximum of the likelihood with the sentence on it and its warnings, or the reason why there is none."""
    try:
        refined = refinement(found.recording, found.modes, system=found.own_model(), matrices=matrices)
    except RecordingError:  # what was asked for cannot be had from these records
        raise
    except IdentificationError as error:
        return None, (), (f"Nothing was refined: {error}.",)
    return refined, (refined.sentence,), refined.warnings


def _order_warnings(realization: Realization, modes: Modes) -> tuple[str, ...]:
    warnings = []
    if not len(modes):
        warnings.append("No pole stays put over the orders, so no mode is found; record for longer.")
    for k in np.flatnonzero(modes.damping_ratio < 0):
        warnings.append(
            f"The mode at {modes.frequency_hz[k]:.4g} Hz grows in time, which no structure at rest does; "
            "it is noise, or the order is too high."
        )
    settings, system = realization.settings, realization.system
    if "n_rows" in settings and "n_columns" in settings:
        width = settings.get("n_references", len(system.inputs))
        n_columns = int(settings["n_columns"]) * int(width)
        limit = min((int(settings["n_rows"]) - 1) * len(system.outputs), n_columns)
        if realization.order > 0.8 * limit:
            warnings.append(
                f"Order {realization.order} is close to {limit}, the most that the Hankel matrix carries, which "
                "leaves nothing to average noise with; take more block rows."
            )
    return tuple(warnings)


def _length_warnings(recording: Recording, realization: Realization, modes: Modes) -> tuple[str, ...]:
    """One sentence when the length of the record keeps a damping ratio from being known, whatever the method.

    Source: Au (2014), Mech. Syst. Signal Process. 48, 15-33, long-record uncertainty laws for ambient data:
        the coefficient of variation of a damping ratio is (2 π ζ N)^-1/2 at best, with N periods recorded.
    """
    if realization.system.inputs or not len(modes):
        return ()
    n_periods = recording.duration * modes.frequency_hz
    known = modes.damping_ratio > 0
    variation = 1 / np.sqrt(2 * np.pi * np.where(known, modes.damping_ratio, 1) * n_periods)
    worst = int(np.argmax(np.where(known, variation, 0)))
    if variation[worst] < 0.25:
        return ()
    return (
        f"{n_periods[worst]:.0f} periods of the mode at {modes.frequency_hz[worst]:.4g} Hz leave its damping ratio "
        f"uncertain by at least {100 * variation[worst]:.0f} %, one standard deviation; record for longer.",
    )
