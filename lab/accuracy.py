"""Accuracy: the substeps that a test needs, found on the start of its first records."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from identification.recording import Array
from lab import stepping
from lab.bench import Bench, swapped
from lab.errors import LabError
from lab.loads import Load
from lab.rig import Rig
from lab.stepping import Plan

PILOT_SAMPLES, MOST_PILOT_SAMPLES = 256, 4096
"""Length of the trial runs on which the error is measured, and at most for lightly damped structures."""

FINEST, FINEST_UNASKED = 4096, 256
"""Most substeps per sample, for an accuracy that was asked for and for the default one."""

IDEAL_ACCURACY = 1e-9
NOISE_SHARE = 1e-3
"""Default error: this share of the smallest noise in the chain, or `IDEAL_ACCURACY` when the chain adds none."""


def accurate(bench: Bench, asked: float | None) -> Bench:
    """The bench with substeps that reach an accuracy, as measured on the start of its first records.

    Args:
        bench: with any plan.
        asked: largest error relative to the largest value of its channel; when None, a small share of the smallest noise.

    Raises:
        LabError: the accuracy cannot be reached.
    """
    if asked is not None and not 1e-13 <= asked < 1:
        raise LabError(f"accuracy is {asked}; expected a relative error from 1e-13 to below 1")
    dt, duration = 1 / bench.sample_rate, bench.loads[0].n_samples / bench.sample_rate
    pilots, growth = _pilots(bench)
    accuracy = IDEAL_ACCURACY if asked is None else asked
    if asked is None and bench.rig.chain.acquisition:
        coarse = replace(bench, plan=stepping.first_guess(bench.rig, dt, 1e-4, duration))
        outputs = [part.outputs for part in coarse.batch(pilots, None)]
        accuracy = _default_accuracy(bench.rig, bench.sample_rate, np.concatenate(outputs, axis=2))
    finest = FINEST if asked is not None else FINEST_UNASKED
    best = plan = _measured(
        bench, stepping.first_guess(bench.rig, dt, accuracy / 2, duration), pilots, growth
    )
    in_vain = 0
    # The rest of the record may err by somewhat more than its start: aim at half of what is asked for.
    aim = accuracy / 2
    # Rounding puts a floor under the error: two finer plans that are hardly better have met it.
    while best.error > aim and plan.substeps < finest and in_vain < 2:
        before = plan.error
        plan = _measured(bench, stepping.finer(bench.rig, dt, plan, aim, finest), pilots, growth)
        in_vain = 0 if plan.error < before / 2 else in_vain + 1
        if in_vain and plan.cancelled and bench.rig.chain.needs_substeps:
            # An instrument clips: there is no power series to cancel.
            plan, in_vain = _measured(bench, replace(plan, cancelled=()), pilots, growth), 0
        best = min(best, plan, key=lambda each: each.error)
    if best.error > accuracy and asked is not None:
        raise LabError(
            f"an accuracy of {accuracy:.1e} is out of reach: the error is {best.error:.1e} with {best.substeps} substeps "
            "per sample; ask for less, or sample faster"
        )
    # For the default accuracy, where kinks and lags cap the order, the best will do; its error is on record.
    return replace(bench, plan=best, accuracy=accuracy)


def _pilots(bench: Bench) -> tuple[list[Load], float]:
    """The start of the first records, and the factor by which the error can still grow after it."""
    settled = 2 * stepping.settling_time(bench.rig) * bench.sample_rate
    n = int(np.clip(settled, PILOT_SAMPLES, MOST_PILOT_SAMPLES))
    whole = bench.loads[0].n_samples
    starts = [replace(load, n_samples=min(n, whole), whole=whole) for load in bench.loads[:4]]
    return starts, max(1.0, min(settled, whole) / n)


def _measured(bench: Bench, plan: Plan, pilots: Sequence[Load], growth: float) -> Plan:
    # What extrapolation leaves of an error in phase grows with its square.
    return replace(plan, error=growth ** (2 if plan.cancelled else 1) * _error(bench, plan, pilots))


def _error(bench: Bench, plan: Plan, pilots: Sequence[Load]) -> float:
    """Largest error, judged by twice the substeps, relative to the largest value of its channel."""
    plans = (plan, stepping.doubled(plan))
    coarse, fine = (
        np.concatenate([part.outputs for part in parts], axis=2)
        for parts in zip(*bench.combined(pilots, plans), strict=True)
    )
    difference = np.max(np.abs(coarse - fine), axis=2)  # (n_batch, n_outputs)
    largest = np.max(np.abs(fine), axis=2)
    # A channel across all motion reads rounding only; it has no scale of its own.
    for unit in {channel.unit for channel in bench.rig.outputs}:
        same = [channel.unit == unit for channel in bench.rig.outputs]
        largest[:, same] = np.maximum(largest[:, same], 1e-6 * np.max(largest[:, same]))
    # The finer run has an error of its own, smaller by the power of two.
    share = 1 - 2.0 ** -stepping.order_left(bench.rig, plan)
    return float(np.max(difference / np.where(largest > 0, largest, 1.0))) / share


def _default_accuracy(rig: Rig, sample_rate: float, outputs: Array) -> float:
    """`NOISE_SHARE` of the smallest noise of an output channel, relative to the largest value of the channel."""
    order = swapped(rig)
    largest, rms = (
        np.max(np.abs(outputs), axis=(0, 2))[order],
        root_mean_square([np.hstack(list(outputs))[order]]),
    )
    shares = []
    for row, channel in enumerate(rig.outputs):
        stages = rig.chain.for_channel("acquisition", channel.name)
        noise = math.hypot(*(stage.noise(1 / sample_rate, rms[row]) for stage in stages))
        if noise > 0 and largest[row] > 0:
            shares.append(noise / largest[row])
    return float(np.clip(NOISE_SHARE * min(shares), 1e-12, 1e-4)) if shares else IDEAL_ACCURACY


def root_mean_square(blocks: Iterable[Array]) -> Array:
    """Root mean square of each row over consecutive blocks, summed block by block."""
    total, n = np.zeros(0), 0
    for block in blocks:
        squares = np.sum(np.ascontiguousarray(block) ** 2, axis=1)
        total = total + squares if n else squares
        n += block.shape[1]
    return np.sqrt(total / n)
