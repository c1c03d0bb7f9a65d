"""SSI-cov: models of the structure from the covariances of its outputs alone.

The covariances R_k = C A^{k-1} G of the outputs with some references fill a block Hankel matrix, whose
leading left singular vectors span the observability matrix of the structure.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from identification.covariance import output_covariances, reference_rows
from identification.output_only import past_and_future, plan_hankel, realized
from identification.recording import Array, Recording
from identification.systems import Realization


def ssi_cov(
    recording: Recording,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    n_rows: int | None = None,
    references: Sequence[str] | None = None,
) -> Realization:
    """Models of every order from the covariances of the outputs with the references (SSI-cov/ref).

    Args:
        recording: outputs of a structure under random excitation, measured or not; inputs are not used.
        order: number of states of the model to choose; the largest gap of the singular values decides when
            None.
        orders: orders to realize besides `order`; when both are None, 2, 4, … up to six for each resonance
            peak in the spectra.
        n_rows: block rows of the Hankel matrix, so that lags 1 to 2 `n_rows` - 1 are used; two thirds
            of a period of the lowest resonance peak when None.
        references: names of the reference outputs, of which each covariance takes one; all outputs when None.

    Returns:
        The models, without inputs, and the leading singular values.

    Raises:
        OrderError: an order below 1, or above what the Hankel matrix can carry.
        TooShortError: the record has fewer samples than lags.
        RecordingError: a reference does not exist, or a sample is missing.

    Source: Peeters and De Roeck (1999), Mech. Syst. Signal Process. 13(6); Cambraia and Kurka (2010), VI
        CONEM, eqs. (24) to (37), with the block columns of eq. (29) in reverse order.
    """
    rows = reference_rows(recording, references)
    plan = plan_hankel(recording, order, orders, n_rows, rows.size)
    R = output_covariances(recording, plan.n_rows + plan.past[-1], references=references)
    scale = balance(R, recording, rows)
    H = past_and_future(R, plan)
    del R
    return realized("ssi_cov", recording, order, plan, H, scale)


def balance(R: Array, recording: Recording, rows: NDArray[np.intp]) -> Array:
    """Bring outputs of different units to one scale, in place; gives that scale, shape (n_outputs, 1).

    Without it the choice of a unit would decide which outputs the truncated subspace follows. Outputs of
    one unit share a scale, because among them the size of a signal does tell its weight against the noise.

    Args:
        R: covariances, shape (n_lags, n_outputs, n_references).
        recording: for the units.
        rows: those of the references, shape (n_references,).

    Returns:
        What the outputs were divided by.
    """
    units = np.array([channel.unit for channel in recording.outputs])
    scale, reference_scale = np.ones(units.size), np.ones(rows.size)
    if np.all(units == units[0]):
        return scale[:, None]
    for unit in set(units[rows]):
        outs, refs = units == unit, units[rows] == unit
        scale[outs] = reference_scale[refs] = np.sqrt(np.linalg.norm(R[:, outs][:, :, refs])) or 1.0
    R /= reference_scale
    for unit in set(units) - set(units[rows]):
        scale[units == unit] = np.linalg.norm(R[:, units == unit]) or 1.0
    R /= scale[:, None]
    return scale[:, None]
