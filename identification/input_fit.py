"""B and D from the recording itself, once A and C are known: the outputs are linear in both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy.linalg

from identification.errors import RecordingError
from identification.recording import Array, Record, Recording
from identification.regression import (
    BLOCK,
    FROM_REST,
    LONG,
    factor_of_products,
    least_squares,
    rms,
    triangular,
)
from identification.systems import Complex, StateSpace


def fit_inputs(system: StateSpace, recording: Recording) -> StateSpace:
    """The model with the B and D whose simulated outputs are nearest to the recorded ones.

    A and C stay. The initial state of each record is fitted with them, except where the kind of record
    says that it starts from rest. Every output counts relative to its RMS. In modal coordinates, x_r(k)
    is the input filtered by 1 / (z - z_r), so the regression needs one filter per pole and input, and one
    triangular factor of these signals, whatever the number of outputs.

    Args:
        system: sampled model with the channels of the recording; a pole outside the unit circle must not
            grow beyond the range of numbers within a record.
        recording: records with inputs.

    Returns:
        The model; least squares block by block, so long records need little memory.

    Raises:
        RecordingError: the channels are not those of the model.

    Source: Ljung (1999), System Identification, 2nd ed., section 10.6.
    """
    if (system.inputs, system.outputs) != (recording.inputs, recording.outputs):
        raise RecordingError(
            f"the recording has {len(recording.inputs)} inputs and {len(recording.outputs)} outputs that "
            f"are not "
            f"those of the model ({len(system.inputs)} and {len(system.outputs)}); select the same channels"
        )
    z, phi = scipy.linalg.eig(system.A)
    own = np.flatnonzero(z.imag >= 0)
    z, phi = z[own], phi[:, own]
    # One of each conjugate pair stands for both: real parts count twice.
    phi = phi * np.where(z.imag > 0, 2.0, 1.0)
    size = rms(recording)[len(system.inputs) :]
    scale = 1 / np.where(size > 0, size, 1)
    n_unknown = _n_columns(system, z) + 2 * z.size * len(recording.records)
    R = np.zeros((0, n_unknown + 1))
    for number, record in enumerate(recording.records):
        weights = _weights(system, recording, number, z, system.C @ phi)
        # All outputs see the same signals, each with weights of its own, so one factor serves them all.
        seen = _factor(record, z, weights.shape[1])
        R = triangular(R, np.vstack([seen @ (each * own) for each, own in zip(scale, weights, strict=True)]))
    theta = least_squares(R[:n_unknown, :n_unknown], R[:n_unknown, n_unknown:], 1e-13)[0][:, 0]
    n_inputs, n_outputs = len(system.inputs), len(system.outputs)
    b = theta[: 2 * z.size * n_inputs].reshape(2, z.size, n_inputs)
    D = theta[2 * z.size * n_inputs : _n_columns(system, z)].reshape(n_outputs, n_inputs)
    return replace(system, B=np.real(phi @ (b[0] + 1j * b[1])), D=D)


def _n_columns(system: StateSpace, z: Complex) -> int:
    return 2 * z.size * len(system.inputs) + system.D.size


def _weights(system: StateSpace, recording: Recording, number: int, z: Complex, shapes: Complex) -> Array:
    """What each of the signals of a record counts in the columns [B | D | initial states | y] of each output's regression.

    Shape (n_outputs, n_signals, n_unknowns + 1).
    """
    n_outputs, n_inputs = system.D.shape
    n_forced, n_fixed = z.size * n_inputs, _n_columns(system, z)
    direct = 2 * n_forced + np.arange(n_inputs)
    free = 0 if recording.records[number].kind in FROM_REST else 2 * z.size
    after = 2 * n_forced + n_inputs
    weights = np.zeros(
        (n_outputs, after + free + n_outputs, n_fixed + 2 * z.size * len(recording.records) + 1)
    )
    for o in range(n_outputs):
        weights[o, : 2 * n_forced, : 2 * n_forced] = _turned(np.repeat(shapes[o], n_inputs))
        weights[o, direct, direct + o * n_inputs] = 1
        if free:
            own = n_fixed + number * free
            weights[o, after : after + free, own : own + free] = _turned(shapes[o])
        weights[o, after + free + o, -1] = 1
    return weights


def _turned(shape: Complex) -> Array:
    """What Re x and Im x count in Re(ψ x b), by the real and the imaginary part of b, one block each."""
    re, im = np.diag(shape.real), np.diag(shape.imag)
    return np.block([[re, -im], [-im, -re]])


def _factor(record: Record, z: Complex, n_signals: int) -> Array:
    """Triangular factor of the signals of a record, through their products where it is long and they have digits enough."""
    if record.n_samples > LONG:
        products = sum(X @ X.T for X in _signals(record, z))
        R = factor_of_products(np.asarray(products), record.n_samples)
        if R is not None:
            return R
    R = np.zeros((0, n_signals))
    for X in _signals(record, z):
        R = triangular(R, X.T)
    return R


def _signals(record: Record, z: Complex) -> Iterator[Array]:
    """Blocks of Re x, Im x, u, Re and Im of the free responses, and y, shape (n_signals, n_block).

    The free responses are left out of a record that begins at rest.
    """
    from scipy.signal import lfilter  # slow to load, and only this fit needs it

    state = np.zeros((z.size, record.inputs.shape[0]), dtype=complex)
    powers, start = z[:, None] ** np.arange(min(BLOCK, record.n_samples)), 0
    for u, y in record.blocks(BLOCK):
        n = u.shape[1]
        x = np.empty((z.size, len(u), n), dtype=complex)
        for r, pole in enumerate(z):
            delayed, last = lfilter([0, 1], [1, -pole], u, zi=state[r][:, None])
            x[r], state[r] = delayed, last[:, 0]
        forced = x.reshape(-1, n)
        free = z[:, None] ** start * powers[:, :n]
        released = [] if record.kind in FROM_REST else [free.real, free.imag]
        yield np.vstack([forced.real, forced.imag, u, *released, y])
        start += n
