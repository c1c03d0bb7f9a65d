"""Gain: how much better the extended model predicts data that no fit has seen, simulated by MuJoCo."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array, Recording
from lab.diagnosis.fit import Fit
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.outcome import Errors, Prediction
from lab.errors import LabError
from lab.hands import shared
from lab.replay import replay
from lab.responder import ready
from lab.rig import Rig
from lab.twin import twin

Driven = tuple[Rig, Sequence[tuple[Array, Array] | None]]
"""A rig, and its displacement and velocity at the start of each record; None where it begins at rest."""
PAST = 30
"""Samples of its own past from which a residual is predicted, to tell noise from what is not noise."""


def predictions_of(
    recording: Recording,
    misfit: Misfit,
    nominal: Callable[[], list[Array]],
    driven: Sequence[Driven],
    *,
    accuracy: float,
    work: Work = UNHEARD,
) -> tuple[Prediction, ...]:
    """Measured outputs and those of nominal, calibrated and extended rig, record by record.

    Args:
        recording: what was measured.
        misfit: of the nominal rig.
        nominal: how to get the outputs of the nominal rig.
        driven: calibrated and extended rig.
        accuracy: of the simulation.
        work: told of every rig.
    """
    # Never in two threads: MuJoCo's callbacks belong to the whole process.
    outputs = shared(partial(simulated, recording, accuracy=accuracy, substeps=misfit.substeps), driven)
    calibrated, extended, as_given = work.each(itertools.chain(outputs, _called(nominal)), len(driven) + 1)
    return tuple(
        Prediction(measured, given, before, after, first)
        for (_, measured), given, before, after, first in zip(
            misfit.records, as_given, calibrated, extended, misfit.n_train, strict=True
        )
    )


def _called(outcome: Callable[[], list[Array]]) -> Iterator[list[Array]]:
    """An outcome, asked for when its turn comes."""
    yield outcome()


def simulated(recording: Recording, driven: Driven, *, accuracy: float, substeps: int) -> list[Array]:
    """Outputs of a rig under the inputs of each record, (n_outputs, n_samples) each, by MuJoCo.

    Args:
        recording: whose inputs drive it.
        driven: rig and starts.
        accuracy: of the simulation.
        substeps: of its own twin: where that agrees, MuJoCo needs no finer steps to show that they are fine enough.
    """
    rig, motions = driven
    expected = _by_the_twin(rig, recording, motions, substeps)
    return replay(rig, recording, accuracy=accuracy, starts=motions, expected=expected)


def _by_the_twin(
    rig: Rig, recording: Recording, motions: Sequence[tuple[Array, Array] | None], substeps: int
) -> list[Array] | None:
    """Outputs of a rig by its twin; None where it has none."""
    try:
        responder = ready(twin(rig).plant, recording.dt, substeps=substeps)
    except LabError:
        return None
    return [
        responder.outputs(
            record.inputs[:, :], record.n_samples, initial=None if motion is None else np.concatenate(motion)
        )
        for record, motion in zip(recording.records, motions, strict=True)
    ]


def errors_of(predictions: Sequence[Prediction], floor: float) -> Errors:
    """RMS error over RMS signal on the samples kept out of every fit, all outputs weighted alike."""

    def error(name: str) -> float:
        return relative_error(
            [
                (p.measured[:, p.first_held_out :], getattr(p, name)[:, p.first_held_out :])
                for p in predictions
            ]
        )

    return Errors(floor, error("nominal"), error("calibrated"), error("extended"))


def relative_error(pairs: Sequence[tuple[Array, Array]]) -> float:
    """RMS over channels of RMS error over RMS signal; missing samples, and channels without any other, left out."""
    measured = np.concatenate([a for a, _ in pairs], axis=1)
    predicted = np.concatenate([b for _, b in pairs], axis=1)
    there = ~np.all(np.isnan(measured), axis=1)
    if not np.any(there):
        return float("nan")
    power = np.nanmean((measured[there] - predicted[there]) ** 2, axis=1)
    signal = np.nanmean(measured[there] ** 2, axis=1)
    return float(np.sqrt(np.mean(power / np.where(signal > 0, signal, 1.0))))


def predicted(misfit: Misfit, found: Fit) -> list[Array]:
    """Whole outputs of every record by the fast twin, (n_outputs, n_samples) each; missing where the measured ones are."""
    whole = tuple(y.shape[1] for _, y in misfit.records)
    e = misfit.residual(found.theta, found.causes, n_train=whole)
    parts = np.split(e, np.cumsum(whole)[:-1], axis=1)
    return [y - part for (_, y), part in zip(misfit.records, parts, strict=True)]


def held_out_error(misfit: Misfit, found: Fit) -> float:
    """The same of a fit, by the fast twin."""
    outputs = predicted(misfit, found)
    return relative_error(
        [
            (y[:, n:], own[:, n:])
            for (_, y), own, n in zip(misfit.records, outputs, misfit.n_train, strict=True)
        ]
    )


def held_out(misfit: Misfit) -> Array:
    """Measured outputs that no fit has seen, of all records."""
    return np.concatenate(
        [y[:, n:] for (_, y), n in zip(misfit.records, misfit.n_train, strict=True)], axis=1
    )


def noise_floor(residual: Array, measured: Array) -> float:
    """Share of a signal that is noise: what of a residual cannot be predicted from its own past."""
    shares = []
    for e, y in zip(residual, measured, strict=True):
        if np.all(np.isnan(y)):
            continue
        rows = np.lib.stride_tricks.sliding_window_view(e, PAST + 1)
        weights = np.linalg.lstsq(rows[:, :PAST], rows[:, PAST], rcond=None)[0]
        innovation = rows[:, PAST] - rows[:, :PAST] @ weights
        power = innovation @ innovation / max(len(innovation) - PAST, 1)
        shares.append(power / max(np.nanmean(y**2), 1e-300))
    return float(np.sqrt(np.mean(shares)))
