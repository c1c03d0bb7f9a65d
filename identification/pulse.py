"""Pulse tests and free decays: recordings that are Markov parameters already, but for scale and order."""

from __future__ import annotations

import numpy as np

from identification.errors import RecordingError
from identification.recording import Array, Channel, Record, Recording
from identification.systems import MarkovParameters


def markov_parameters(recording: Recording) -> MarkovParameters:
    """Responses to a unit pulse in each input, or the free decays side by side.

    Pulses: each record has one input that acts during one sample and is divided by the height of that pulse;
    several pulses on one input are averaged with the weight of least squares. Free decays: each record is a
    column of its own, C Aᵏ x(0) from lag 1 on, with a pseudo-input named `release1`, `release2`, …

    Args:
        recording: records of kind `pulse`, or records of kind `free_decay`, from rest.

    Returns:
        As many lags as the shortest record has after its pulse.

    Raises:
        RecordingError: another kind, an input that is no pulse, an input without any, or a missing sample.

    Source: Juang (1992), thesis, eq. (2.16) to (2.18).
    """
    recording.require_complete()
    kinds = {record.kind for record in recording.records}
    if kinds == {"pulse"} and recording.inputs:
        return _pulse_responses(recording)
    if kinds == {"free_decay"}:
        return _free_decays(recording)
    raise RecordingError(
        f"records of kind {', '.join(sorted(kinds))} with {len(recording.inputs)} inputs are not pulse "
        f"responses; "
        "expected pulse records with inputs, or free_decay records; use okid for other inputs"
    )


def _pulse_responses(recording: Recording) -> MarkovParameters:
    pulses = [_pulse(recording, number) for number in range(len(recording.records))]
    covered = {row for row, _, _ in pulses}
    missing = [channel.name for row, channel in enumerate(recording.inputs) if row not in covered]
    if missing:
        raise RecordingError(
            f"no record has a pulse on input {', '.join(missing)}; add one per input or select the inputs "
            f"that have"
        )
    n_lags = min(
        record.n_samples - sample for record, (_, sample, _) in zip(recording.records, pulses, strict=True)
    )
    values = np.zeros((n_lags, len(recording.outputs), len(recording.inputs)))
    weight = np.zeros(len(recording.inputs))
    for record, (row, sample, height) in zip(recording.records, pulses, strict=True):
        values[:, :, row] += height * np.asarray(record.outputs[:, sample : sample + n_lags]).T
        weight[row] += height**2
    return MarkovParameters(values / weight, recording.dt, recording.inputs, recording.outputs)


def _pulse(recording: Recording, number: int) -> tuple[int, int, float]:
    """Input row, sample and height of the pulse of a record."""
    record = recording.records[number]
    u = np.array(record.inputs[:, :], dtype=float)
    if not u.size or not u.any():
        raise RecordingError(f"record {number} is of kind pulse and its inputs are zero; leave it out")
    row, sample = np.unravel_index(int(np.argmax(np.abs(u))), u.shape)
    height = float(u[row, sample])
    u[row, sample] = 0
    # Noise of the force channel passes; a second sample, or a second input, does not.
    if np.max(np.abs(u)) > 0.05 * abs(height):
        other, at = np.unravel_index(int(np.argmax(np.abs(u))), u.shape)
        raise RecordingError(
            f"record {number} is no pulse: input {recording.inputs[row].name!r} has {height:.3g} at sample "
            f"{sample} "
            f"and {recording.inputs[other].name!r} has {u[other, at]:.3g} at sample {at}; use okid for "
            f"such inputs"
        )
    return int(row), int(sample), height


def _free_decays(recording: Recording) -> MarkovParameters:
    n_samples = min(record.n_samples for record in recording.records)
    values = np.zeros((n_samples + 1, len(recording.outputs), len(recording.records)))
    for column, record in enumerate(recording.records):
        _require_no_force(record, column)
        values[1:, :, column] = np.asarray(record.outputs[:, :n_samples]).T
    releases = tuple(Channel(f"release{i + 1}", "1") for i in range(len(recording.records)))
    return MarkovParameters(values, recording.dt, releases, recording.outputs)


def _require_no_force(record: Record, number: int) -> None:
    u: Array = np.asarray(record.inputs[:, :])
    if u.size and u.any():
        raise RecordingError(
            f"record {number} is of kind free_decay and its inputs are not zero; cut it to the time after "
            f"the release"
        )
