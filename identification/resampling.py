"""How far the randomness of a record moves any estimate: by leaving parts of it out, one after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError, TooShortError
from identification.progress import UNHEARD, Work
from identification.recording import Array, Record, Recording

STATIONARY = ("ambient", "random", "burst_random", "sweep", "multisine", "other")
"""Kinds of record in which one stretch tells much the same as another."""

PARTS = 20


def jackknife_std(
    recording: Recording,
    estimate: Callable[[Recording], Array],
    *,
    n_parts: int = PARTS,
    work: Work = UNHEARD,
) -> Array:
    """One standard deviation of an estimate, from estimates that lack one part of the recording each.

    Args:
        recording: of one of the kinds `STATIONARY`.
        estimate: what is wanted from a recording, shape (n_values,); NaN where it cannot be had.
        n_parts: how many parts of equal length.
        work: told of every part left out.

    Returns:
        Shape (n_values,); infinite where an estimate could not be had without a part.

    Raises:
        TooShortError: fewer samples than parts.
        IdentificationError: records of another kind, whose beginning tells more than their end.

    Source: Künsch (1989), Ann. Stat. 17(3), eq. (2.3), the jackknife by blocks, here side by side.
    """
    kinds = {record.kind for record in recording.records}
    if not kinds <= set(STATIONARY):
        raise IdentificationError(
            f"records of kind {', '.join(sorted(kinds - set(STATIONARY)))} cannot spare a part; "
            "repeat the test and compare, or take a method with error bars of its own"
        )
    if recording.n_samples < n_parts:
        raise TooShortError(
            f"{recording.n_samples} samples cannot be cut into {n_parts} parts; record for longer"
        )
    return spread_of_parts(
        np.stack([estimate(without_part(recording, part, n_parts)) for part in work.each(range(n_parts))])
    )


def spread_of_parts(values: Array) -> Array:
    """One standard deviation from estimates that lack one of several equal parts each, shape (n_values,).

    Args:
        values: shape (n_parts, n_values); NaN where an estimate could not be had, which makes it infinite.

    Returns:
        In the unit of the values.

    Source: Künsch (1989), Ann. Stat. 17(3), eq. (2.3).
    """
    n_parts = len(values)
    lost = ~np.all(np.isfinite(values), axis=0)
    spread = np.where(lost, 0.0, values)
    variance = (n_parts - 1) / n_parts * np.sum((spread - spread.mean(axis=0)) ** 2, axis=0)
    return np.asarray(np.where(lost, np.inf, np.sqrt(variance)))


def without_part(recording: Recording, part: int, n_parts: int) -> Recording:
    """The recording without one of `n_parts` parts of equal length; a record cut in two becomes two records.

    Args:
        recording: any.
        part: number of the part, from 0.
        n_parts: how many there are.

    Returns:
        The other samples, in order.
    """
    borders = np.linspace(0, recording.n_samples, n_parts + 1).astype(int)
    first, last = int(borders[part]), int(borders[part + 1])
    records: list[Record] = []
    for record in recording.records:
        for start, stop in ((0, min(first, record.n_samples)), (max(last, 0), record.n_samples)):
            if stop > start:
                inputs = record.inputs[:, start:stop] if record.inputs.shape[0] else record.inputs
                outputs = np.asarray(record.outputs[:, start:stop])
                records.append(replace(record, inputs=np.asarray(inputs), outputs=outputs))
        first, last = first - record.n_samples, last - record.n_samples
    return replace(recording, records=tuple(records))
