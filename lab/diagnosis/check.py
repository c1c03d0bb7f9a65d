"""Check: whether a recording can tell anything about a model, before any fit; what it cannot, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.modes import Modes
from identification.recording import Array, Recording
from lab.diagnosis.misfit import SHARE
from lab.errors import LabError
from lab.rig import Rig

QUIET = 0.01
"""Share of the mean power below which a band counts as not excited."""
COLLINEAR = 1e-6
"""Smallest over largest singular value of the inputs, each of unit power, below which they count as one."""
LISTED = 5
LEAST = 100
"""Samples below which neither noise nor a fit can be judged: noise is told from thirty samples of its own past."""


def check(recording: Recording, rig: Rig) -> tuple[str, ...]:
    """What these data cannot tell about this model, one sentence each; none when nothing speaks against them.

    Args:
        recording: with the channels of the rig.
        rig: the model.
    """
    modes = rig.second_order().modes()
    inputs = [np.asarray(record.inputs[:, :]) for record in recording.records if record.inputs.shape[0]]
    return (
        *_dead_channels(recording),
        *_beyond_sampling(recording, modes),
        *_too_short(recording, modes),
        *_alike(recording, inputs),
        *_unexcited(recording, inputs, modes),
    )


def living(recording: Recording, baseline: Recording | None = None) -> tuple[Recording, tuple[str, ...]]:
    """The recording without outputs that never change, there or in a baseline, and a sentence on those left out.

    What fits do not see does not count: a channel must change in the first `SHARE` of a record.

    Raises:
        LabError: a force is missing, a sample infinite; or there are too few samples, no output changes, nothing pushes a
            structure that does not decay freely either, or nothing is left to keep aside.
    """
    _all_known(recording)
    n = sum(int(SHARE * record.n_samples) for record in recording.records)
    if n < LEAST:
        raise LabError(f"fits would see {n} samples; expected at least {LEAST}: record longer")
    names = [channel.name for channel in recording.outputs]
    dead = {
        channel.name
        for each in (recording, *(() if baseline is None else (baseline,)))
        for channel, moved in zip(each.outputs, _changing(each, "outputs", SHARE), strict=True)
        if not moved
    }
    kept, dropped = ([name for name in names if (name in dead) is out] for out in (False, True))
    part = f"in the first {100 * SHARE:g} % of any record, which is what fits see"
    if not kept:
        raise LabError(f"no output ever changes {part}; expected signals: check how the recording was made")
    driven = [record for record in recording.records if record.inputs.shape[0]]
    decays = len(driven) < len(recording.records) or any(record.kind == "free_decay" for record in driven)
    if not decays and not np.any(_changing(recording, "inputs", SHARE)):
        raise LabError(
            f"input {listed([channel.name for channel in recording.inputs])} never changes {part}; expected measured forces, "
            "or records of kind 'free_decay'"
        )
    if not any(np.any(~np.isnan(r.outputs[:, int(SHARE * r.n_samples) :])) for r in recording.records):
        raise LabError(
            f"every output sample behind the first {100 * SHARE:g} % of each record is missing; some must be left to keep "
            "aside: cut the recording where it ends"
        )
    if not dropped:
        return recording, ()
    said = f"output {listed(dropped)} never changes: it was left out; check the channel"
    return recording.select(outputs=kept), (said,)


def _all_known(recording: Recording) -> None:
    """Raises LabError where a force is missing or a sample is infinite; outputs may be missing."""
    for number, record in enumerate(recording.records):
        for side, lost in (("inputs", np.isnan), ("outputs", np.isinf), ("inputs", np.isinf)):
            signal = np.asarray(getattr(record, side)[:, :])
            wrong = np.argwhere(lost(signal))
            if len(wrong):
                row, sample = wrong[0]
                what = "missing" if lost is np.isnan else "infinite"
                raise LabError(
                    f"{side[:-1]} {getattr(recording, side)[row].name} is {what} in sample {sample} of record {number}; "
                    "expected every force, and finite numbers: mend it, or cut the recording there"
                )


def _changing(recording: Recording, side: str, share: float = 1.0) -> np.ndarray:
    """Whether each channel of a side changes in the first share of any record."""
    moves = np.zeros(len(getattr(recording, side)), dtype=bool)
    for record in recording.records:
        if getattr(record, side).shape[0]:
            signal = np.asarray(getattr(record, side)[:, : int(share * record.n_samples)])
            known = ~np.isnan(signal)
            lowest = np.min(signal, axis=1, where=known, initial=np.inf)
            moves |= np.max(signal, axis=1, where=known, initial=-np.inf) > lowest
    return moves


def _dead_channels(recording: Recording) -> list[str]:
    """Channels that never move."""
    said = []
    for side in ("inputs", "outputs"):
        moves = _changing(recording, side)
        dead = [c.name for c, moved in zip(getattr(recording, side), moves, strict=True) if not moved]
        if dead:
            said.append(
                f"{side[:-1]} {listed(dead)} never changes: nothing can be learned from it; check the channel"
            )
    return said


def _beyond_sampling(recording: Recording, modes: Modes) -> list[str]:
    """Modes that the sampling cannot show."""
    half = recording.sample_rate / 2
    beyond = modes.frequency_hz[modes.frequency_hz > half]
    if not beyond.size:
        return []
    return [
        f"the model's modes at {hertz(beyond)} lie beyond half the sample rate ({half:.4g} Hz): what shapes only them cannot "
        "be learned; sample faster"
    ]


def _too_short(recording: Recording, modes: Modes) -> list[str]:
    """Records in which the lowest mode does not swing once."""
    longest = max(record.n_samples for record in recording.records) / recording.sample_rate
    swinging = modes.frequency_hz[modes.frequency_hz > 0]
    if not swinging.size or longest * swinging[0] >= 1:
        return []
    return [
        f"the longest record lasts {longest:.3g} s, and the lowest mode needs {1 / swinging[0]:.3g} s for one swing: record "
        "longer"
    ]


def _alike(recording: Recording, inputs: Sequence[Array]) -> list[str]:
    """Inputs that are one and the same signal, or sums of one another."""
    if len(recording.inputs) < 2 or not inputs:
        return []
    u = np.concatenate(inputs, axis=1)
    power = np.sqrt(np.sum(u**2, axis=1))
    driven = np.flatnonzero(power > 0)
    if driven.size < 2:
        return []
    U, s, _ = np.linalg.svd(u[driven] / power[driven, None], full_matrices=False)
    if s[-1] > COLLINEAR * s[0]:
        return []
    weight = np.abs(U[:, -1])
    names = [recording.inputs[i].name for i in driven[weight > 0.1 * weight.max()]]
    return [
        f"the inputs {listed(names)} drive as one signal: which of their actuators is wrong cannot be told; drive one at a "
        "time or with signals of their own"
    ]


def _unexcited(recording: Recording, inputs: Sequence[Array], modes: Modes) -> list[str]:
    """Modes in whose half-power band the inputs have next to no power."""
    if not inputs:
        return []
    quiet = []
    spectra = [_density(u, recording.dt) for u in inputs]
    for frequency, ratio in zip(modes.frequency_hz, modes.damping_ratio, strict=True):
        if not 0 < frequency <= recording.sample_rate / 2:
            continue
        levels = []
        for f, density in spectra:
            # At least two lines on either side, however sharp the mode.
            half = max(abs(ratio) * frequency, 2.5 * f[1])
            levels.append(np.mean(density[np.abs(f - frequency) <= half]) / max(np.mean(density), 1e-300))
        if max(levels) < QUIET:
            quiet.append(frequency)
    if not quiet:
        return []
    return [
        f"the inputs have next to no power at the model's modes at {hertz(np.array(quiet))}: what shapes only them cannot be "
        "learned; excite a wider band"
    ]


def _density(u: Array, dt: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and the power of all inputs together there."""
    spectrum = np.abs(np.fft.rfft(np.nan_to_num(u), axis=1)) ** 2
    return np.asarray(np.fft.rfftfreq(u.shape[1], dt), dtype=float), np.asarray(spectrum.sum(axis=0))


def listed(names: Sequence[str]) -> str:
    """Names as one reads them, a long list cut short."""
    if len(names) > LISTED:
        return f"{', '.join(names[:LISTED])} and {len(names) - LISTED} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def hertz(frequencies: Array) -> str:
    """Frequencies as one reads them."""
    return f"{listed([f'{f:.4g}' for f in frequencies])} Hz"
