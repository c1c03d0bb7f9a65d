"""B and D from the recording itself, once A and C are known: the outputs are linear in both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy.linalg

from identification.errors import RecordingError
from identification.recording import Array, Recording
from identification.regression import BLOCK, FROM_REST, least_squares, rms, triangular
from identification.systems import Complex, StateSpace


def fit_inputs(system: StateSpace, recording: Recording) -> StateSpace:
    """The model with the B and D whose simulated outputs are nearest to the recorded ones.

    A and C stay. The initial state of each record is fitted with them, except where the kind of record
    says that it starts from rest. Every output counts relative to its RMS. In modal coordinates, x_r(k)
    is the input filtered by 1 / (z - z_r), so the regression needs one filter per pole and input,
    whatever the number of outputs.

    Args:
        system: sampled model with the channels of the recording; a pole outside the unit circle must not
            grow beyond the range of numbers within a record.
        recording: records with inputs.

    Returns:
        The model; least squares by orthogonal factorization, block by block, so long records need
        little memory.

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
    n_unknown = _n_columns(system, z) + 2 * z.size * len(recording.records)
    R = np.zeros((0, n_unknown + 1))
    for rows in _rows(system, recording, z, system.C @ phi):
        R = triangular(R, rows)
    theta = least_squares(R[:n_unknown, :n_unknown], R[:n_unknown, n_unknown:], 1e-13)[0][:, 0]
    n_inputs, n_outputs = len(system.inputs), len(system.outputs)
    b = theta[: 2 * z.size * n_inputs].reshape(2, z.size, n_inputs)
    D = theta[2 * z.size * n_inputs : _n_columns(system, z)].reshape(n_outputs, n_inputs)
    return replace(system, B=np.real(phi @ (b[0] + 1j * b[1])), D=D)


def _n_columns(system: StateSpace, z: Complex) -> int:
    return 2 * z.size * len(system.inputs) + system.D.size


def _rows(system: StateSpace, recording: Recording, z: Complex, shapes: Complex) -> Iterator[Array]:
    """Regression rows [B | D | initial states | y] of outputs scaled to unit RMS, block by block."""
    from scipy.signal import lfilter  # slow to load, and only this fit needs it

    n_outputs, n_inputs = system.D.shape
    size = rms(recording)[n_inputs:]
    scale = 1 / np.where(size > 0, size, 1)
    n_fixed = _n_columns(system, z)
    n_records = len(recording.records)
    for number, record in enumerate(recording.records):
        state = np.zeros((z.size, n_inputs), dtype=complex)
        start = 0
        for u, y in record.blocks(max(1, BLOCK // n_outputs)):
            n = u.shape[1]
            x = np.empty((z.size, n_inputs, n), dtype=complex)
            for r, pole in enumerate(z):
                delayed, last = lfilter([0, 1], [1, -pole], u, zi=state[r][:, None])
                x[r], state[r] = delayed, last[:, 0]
            rows = np.zeros((n_outputs, n, n_fixed + 2 * z.size * n_records + 1))
            gx = np.einsum("or,rjk->okrj", shapes, x).reshape(n_outputs, n, -1)
            rows[:, :, : gx.shape[2]] = gx.real
            rows[:, :, gx.shape[2] : 2 * gx.shape[2]] = -gx.imag
            for o in range(n_outputs):
                first = 2 * gx.shape[2] + o * n_inputs
                rows[o, :, first : first + n_inputs] = u.T
            if record.kind not in FROM_REST:
                free = np.einsum("or,rk->okr", shapes, z[:, None] ** (start + np.arange(n)))
                first = n_fixed + 2 * z.size * number
                rows[:, :, first : first + z.size] = free.real
                rows[:, :, first + z.size : first + 2 * z.size] = -free.imag
            rows[:, :, -1] = y
            start += n
            yield (rows * scale[:, None, None]).reshape(n_outputs * n, -1)
