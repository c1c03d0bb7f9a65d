"""SSI-data: models of the structure from the projection of future outputs onto past references.

What the past tells about the future passes through the state: the projection is O X̂, the observability
    matrix times estimates of the states. A triangular factorization gives it, record by record and block by
    block.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from identification.covariance import reference_rows
from identification.errors import TooShortError
from identification.output_only import Plan, plan_hankel, realized
from identification.recording import Array, Record, Recording
from identification.systems import Realization

BLOCK = 1 << 16
VALUES = 1 << 22
"""Entries of the matrix factorized at a time, 32 MiB; a wide matrix takes as many as make it square."""


def ssi_data(
    recording: Recording,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    n_rows: int | None = None,
    references: Sequence[str] | None = None,
) -> Realization:
    """Models of every order from the projection of the future onto the past of the references (SSI-data/ref).

    The data enter as they are, not squared, so that data without noise keep all digits; it takes many times
    as long as `ssi_cov`, with models that are no better where there is noise.

    Args:
        recording: outputs of a structure under random excitation, measured or not; inputs are not used.
        order: number of states of the model to choose; the largest gap of the singular values decides when
            None.
        orders: orders to realize besides `order`; when both are None, as for `ssi_cov`.
        n_rows: block rows of the future and of the past; as for `ssi_cov` when None.
        references: names of the outputs whose past is projected onto; all outputs when None.

    Returns:
        The models, without inputs, and the leading singular values.

    Raises:
        OrderError: an order below 1, or above what the matrix can carry.
        TooShortError: fewer samples than rows of the matrix.
        RecordingError: a reference does not exist, or a sample is missing.

    Source: Peeters and De Roeck (1999), Mech. Syst. Signal Process. 13(6), the LQ factorization
        [Y_past; Y_future] = [L₁₁, 0; L₂₁, L₂₂] [Q₁; Q₂] of the block Hankel matrix of the outputs. The
        projection Y_future / Y_past = L₂₁ Q₁ = O X̂, and Q₁ does not change the left singular vectors.
    """
    recording.require_complete()
    rows = reference_rows(recording, references)
    plan = plan_hankel(recording, order, orders, n_rows, rows.size)
    n_past, n_future = plan.n_columns * rows.size, plan.n_rows * len(recording.outputs)
    span = plan.past[-1] + 1 + plan.n_rows
    n_columns = sum(max(record.n_samples - span + 1, 0) for record in recording.records)
    if n_columns < n_past + n_future:
        raise TooShortError(
            f"{n_past} past and {n_future} future rows need as many columns and the records give {n_columns}; "
            "take fewer block rows or references, or use ssi_cov"
        )
    scale = _unit_scale(recording)
    L = np.zeros((0, n_past + n_future))
    for record in recording.records:
        for columns in _windows(record, span, n_past + n_future):
            stacked = np.vstack([L, _past_and_future(columns / scale, plan, rows)])
            L = np.asarray(np.linalg.qr(stacked, mode="r"))
    return realized("ssi_data", recording, order, plan, L[:n_past, n_past:].T / np.sqrt(n_columns), scale)


def _windows(record: Record, span: int, n_rows: int) -> Iterator[Array]:
    """Consecutive parts of a record without its mean, overlapping so that each window of `span` is in one of them."""
    n = record.n_samples
    mean = sum((np.sum(y, axis=1, keepdims=True) for _, y in record.blocks(BLOCK)), np.zeros((1, 1))) / max(
        n, 1
    )
    rest = np.zeros((record.outputs.shape[0], 0))
    for _, block in record.blocks(max(n_rows, VALUES // n_rows, 4 * span)):
        part = np.hstack([rest, block - mean])
        if part.shape[1] >= span:
            yield part
            rest = part[:, part.shape[1] - span + 1 :]
        else:
            rest = part


def _past_and_future(y: Array, plan: Plan, rows: NDArray[np.intp]) -> Array:
    """Transposed block Hankel matrix, a row for each instant: references before it, latest first, and outputs from it on."""
    last = plan.past[-1]
    n = y.shape[1] - last - plan.n_rows
    before = [y[rows, last - lag : last - lag + n] for lag in plan.past]
    after = [y[:, last + 1 + i : last + 1 + i + n] for i in range(plan.n_rows)]
    return np.vstack(before + after).T


def _unit_scale(recording: Recording) -> Array:
    """Root mean square of all outputs of each unit, at each output, shape (n_outputs, 1)."""
    square = np.zeros(len(recording.outputs))
    for record in recording.records:
        for _, y in record.blocks(BLOCK):
            square += np.sum(y**2, axis=1)
    units = np.array([channel.unit for channel in recording.outputs])
    total = np.array([np.mean(square[units == unit]) for unit in units]) / max(recording.n_samples, 1)
    return np.asarray(np.sqrt(np.where(total == 0, 1, total)))[:, None]
