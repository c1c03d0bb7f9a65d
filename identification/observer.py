"""The predictor of the next output from past inputs and outputs, of a length chosen from the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError, RecordingError, TooShortError
from identification.lagged_products import lagged_products
from identification.recording import Array, Recording
from identification.regression import (
    BLOCK,
    FROM_REST,
    LONG,
    factor_of_products,
    least_squares,
    rms,
    triangular,
)

MOST_COLUMNS = 600
"""Columns of the regression at the longest observer tried, for the sake of time."""


@dataclass(frozen=True, eq=False)
class Observer:
    """y(k) = D u(k) + Σ beta_i u(k - i) + Σ alpha_i y(k - i) for i = 1 … length, in channels of unit RMS.

    Attributes:
        direct: D, shape (n_outputs, n_inputs).
        alpha: shape (length, n_outputs, n_outputs).
        beta: shape (length, n_outputs, n_inputs).
        input_rms: of the recording, shape (n_inputs,).
        output_rms: likewise, shape (n_outputs,).
        residual: RMS of the prediction error over that of the output, shape (n_outputs,).
        exact: whether the data are free of noise, so that the length matters for rounding only.
        note: how the length was chosen, one sentence.
    """

    direct: Array
    alpha: Array
    beta: Array
    input_rms: Array
    output_rms: Array
    residual: Array
    exact: bool
    note: str

    @property
    def length(self) -> int:
        """Samples that the observer looks back."""
        return int(self.alpha.shape[0])

    def markov(self, n_lags: int) -> Array:
        """Markov parameters of the structure in scaled channels, shape (n_lags, n_outputs, n_inputs).

        They are the response of the predictor to a unit pulse: Y_k = beta_k + Σ alpha_i Y_(k - i) with
        i = 1 … min(k, length), and Y_0 = D.

        Raises:
            IdentificationError: the response grows beyond all bounds.

        Source: Juang, Phan, Horta and Longman (1993), J. Guidance 16(2), 320-329.
        """
        Y = np.zeros((n_lags, *self.direct.shape))
        Y[:1] = self.direct
        for k in range(1, n_lags):
            depth = min(k, self.length)
            Y[k] = np.einsum("ioq,iqj->oj", self.alpha[:depth], Y[k - depth : k][::-1])
            if k <= self.length:
                Y[k] += self.beta[k - 1]
            if np.max(np.abs(Y[k])) > 1e100:
                raise IdentificationError(
                    f"the pulse response from an observer of length {self.length} grows without bound; "
                    "take a longer observer, or fewer lags"
                )
        return Y


def observe(recording: Recording, *, observer: int | None = None) -> Observer:
    """The predictor that fits the recording best, of a length chosen from the data when None.

    One triangular factor serves all lengths: the rows of its last columns below the columns of a length
    are the prediction errors left at that length. With noise, the length is twice the one that minimizes
    Akaike's corrected criterion, which is made for the next sample; poles profit from a longer look back.
    Without noise any length that is long enough is exact, and the longest is the best conditioned.

    Args:
        recording: one or more records with inputs; records of kind pulse or impact are taken to start
            from rest.
        observer: the length, or None.

    Returns:
        The predictor in channels of unit RMS, its error, and how its length was chosen.

    Raises:
        RecordingError: no inputs, a missing sample, or a channel that is zero throughout.
        TooShortError: too few samples.
        IdentificationError: the length asked for is less than one.

    Source: Juang, Phan, Horta and Longman (1993), J. Guidance 16(2), without the assumption of rest:
        least squares for y(k) = D u(k) + Σ beta_i u(k-i) + Σ alpha_i y(k-i). The criterion is that of
        Hurvich and Tsai (1989), Biometrika 76(2), for several outputs,
        n log|E| + 2 n k q / (n - k - q - 1) with n rows, k columns, q outputs and mean square errors E.
    """
    _require_excitation(recording)
    scale = rms(recording)
    n_inputs, n_outputs = len(recording.inputs), len(recording.outputs)
    width = n_inputs + n_outputs
    if observer is not None and observer < 1:
        raise IdentificationError(f"the observer looks back {observer} samples; expected at least one")
    longest = _longest(recording) if observer is None else observer
    R, n_rows = _factor(recording, scale, longest)
    split = n_inputs + longest * width
    lengths = np.arange(1, longest + 1, dtype=np.int64)
    # Mean square errors of each length, (longest, n_outputs, n_outputs)
    errors = _mean_squares(R[:, split:], n_inputs + lengths * width) / n_rows
    exact = bool(np.max(np.trace(errors[-1])) < n_outputs * 1e-18)
    p, note = longest, f"The observer looks back {longest} samples, as asked for."
    if observer is None:
        p, note = _choose(errors, n_rows, width, exact)
    n_columns = n_inputs + p * width
    theta, _ = least_squares(R[:n_columns, :n_columns], R[:n_columns, split:], 1e-10 if exact else 1e-13)
    past = theta[n_inputs:].reshape(p, width, n_outputs).transpose(0, 2, 1)
    return Observer(
        theta[:n_inputs].T,
        past[:, :, n_inputs:],
        past[:, :, :n_inputs],
        scale[:n_inputs],
        scale[n_inputs:],
        np.sqrt(np.diag(errors[p - 1])),
        exact,
        note,
    )


def _require_excitation(recording: Recording) -> None:
    if not recording.inputs or any(record.inputs.shape[0] == 0 for record in recording.records):
        raise RecordingError(
            "observer identification needs measured inputs in every record; use an output-only method"
        )
    recording.require_complete()
    for channel, size in zip((*recording.inputs, *recording.outputs), rms(recording), strict=True):
        if size == 0:
            raise RecordingError(f"channel {channel.name!r} is zero throughout; leave it out")


def _longest(recording: Recording) -> int:
    """Longest observer to try: three rows for each column, and no more than `MOST_COLUMNS` columns."""
    n_inputs, width = len(recording.inputs), len(recording.inputs) + len(recording.outputs)
    p = 0
    while n_inputs + (p + 1) * width <= min(MOST_COLUMNS, _n_rows(recording, p + 1) / 3):
        p += 1
    if not p:
        raise TooShortError(
            f"{recording.n_samples} samples are too few for an observer of {width} channels; "
            "lengthen the record or leave channels out"
        )
    return p


def _n_rows(recording: Recording, p: int) -> int:
    return sum(
        record.n_samples if record.kind in FROM_REST else max(record.n_samples - p, 0)
        for record in recording.records
    )


def _factor(recording: Recording, scale: Array, p: int) -> tuple[Array, int]:
    """Triangular factor of the rows [u(k), v(k - 1), …, v(k - p), y(k)], v = (u, y), and their number.

    Long records are factored through their products, unless rounding would tell beside the noise.
    """
    n_inputs, width = len(recording.inputs), scale.size
    n_columns = n_inputs + p * width
    n_rows = _n_rows(recording, p)
    if n_rows < n_columns:
        raise TooShortError(
            f"an observer of length {p} has {n_columns} coefficients per output for {n_rows} samples; "
            "shorten it or lengthen the record"
        )
    if n_rows > LONG:
        products = lagged_products(recording, scale, p)
        order = np.r_[:n_inputs, width : len(products), n_inputs:width]
        factor = factor_of_products(products[np.ix_(order, order)], n_rows)
        if factor is not None:
            return factor, n_rows
    R = np.zeros((0, n_columns + width - n_inputs))
    for record in recording.records:
        past = np.zeros((width, p))
        known = record.kind in FROM_REST
        for u, y in record.blocks(BLOCK):
            v = np.hstack([past, np.vstack([u, y]) / scale[:, None]])
            windows = np.lib.stride_tricks.sliding_window_view(v, p + 1, axis=1)[
                :, :, ::-1
            ]  # (width, n, p + 1)
            now = windows[:, :, 0].T
            back = windows[:, :, 1:].transpose(1, 2, 0).reshape(now.shape[0], -1)
            rows = np.hstack([now[:, :n_inputs], back, now[:, n_inputs:]])
            rows = rows if known else rows[p:]
            R = triangular(R, rows) if rows.size else R
            past, known = v[:, v.shape[1] - p :], True
    return R, n_rows


def _mean_squares(R: Array, first: NDArray[np.int64]) -> Array:
    """Σ r rᵀ over the rows of R from each of `first` on, shape (len(first), n, n)."""
    squares = np.cumsum((R[:, :, None] * R[:, None, :])[::-1], axis=0)[::-1]
    return np.asarray(np.concatenate([squares, np.zeros_like(squares[:1])])[first])


def _choose(errors: Array, n_rows: int, width: int, exact: bool) -> tuple[int, str]:
    longest, n_outputs = errors.shape[:2]
    lengths = np.arange(1, longest + 1)
    if exact:
        enough = int(np.argmax(np.trace(errors, axis1=1, axis2=2) < n_outputs * 1e-18)) + 1
        return longest, (
            f"The observer looks back {longest} samples: without noise {enough} are enough, and more "
            f"improve the "
            "conditioning."
        )
    n_columns = lengths * width
    # The floor keeps the determinant finite where two outputs read the same.
    log_det = np.linalg.slogdet(errors + 1e-24 * np.eye(n_outputs))[1]
    criterion = n_rows * log_det + 2 * n_columns * n_outputs * n_rows / (n_rows - n_columns - n_outputs - 1)
    best = int(np.argmin(criterion)) + 1
    p = min(2 * best, longest)
    limit = ", the most that the record and the time allow" if p < 2 * best else ""
    return p, (
        f"The observer looks back {p} samples{limit}: Akaike's corrected criterion is least at {best}, and "
        f"poles "
        "profit from more."
    )
