"""Natural excitation technique: correlations of random responses, realized as if they were free decays.

Under white excitation the covariances R_k, k >= 1, are free decays of the structure, one for each reference.
R_0 is not: it carries the noise of the sensors, and stays out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from identification.covariance import output_covariances, reference_rows
from identification.output_only import (
    gathered,
    leading_subspace,
    orders_within_rank,
    past_and_future,
    plan_hankel,
)
from identification.recording import Recording
from identification.ssi import balance
from identification.systems import Realization


def next_era(
    recording: Recording,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    n_rows: int | None = None,
    references: Sequence[str] | None = None,
) -> Realization:
    """Models of every order from the covariances of the outputs with references, by ERA (NExT-ERA).

    Args:
        recording: outputs of a structure under random excitation, measured or not; inputs are not used.
        order: number of states of the model to choose; the largest gap of the singular values decides when
            None.
        orders: orders to realize besides `order`; chosen from the spectra when both are None.
        n_rows: block rows of the Hankel matrix; chosen from the lowest resonance when None.
        references: names of the reference outputs, each of which gives a free decay; all when None.

    Returns:
        The models, without inputs, and all singular values.

    Raises:
        OrderError: an order below 1, or above what the Hankel matrix can carry.
        TooShortError: the record has fewer samples than lags.
        RecordingError: a reference does not exist, or a sample is missing.

    Source: James, Carne and Lauffer (1995), Int. J. Anal. Exp. Modal Anal. 10(4), 260-277, R_k = C A^{k-1} G
        for k >= 1; realized as in Juang (1992), thesis, eq. (3.15): A = Σ^-½ Pᵀ H(1) Q Σ^-½, C = [I 0 …] P Σ^½.
    """
    rows = reference_rows(recording, references)
    plan = plan_hankel(recording, order, orders, n_rows, rows.size)
    R = output_covariances(recording, plan.n_rows + plan.past[-1] + 1, references=references)
    scale = balance(R, recording, rows)  # (n_outputs, 1)
    H0, H1 = (past_and_future(R[lag:], plan) for lag in (0, 1))
    U, singular_values = leading_subspace(H0, plan.orders[-1] + 2)
    wanted = orders_within_rank(plan, singular_values, H0.shape)
    P, S = U[:, : wanted[-1]], singular_values[: wanted[-1]]
    root = np.sqrt(S)
    A = P.T @ H1 @ (H0.T @ P / S) / root[:, None] / root  # nested: order n is the leading block
    C = scale * P[: len(scale)] * root
    models = [(A[:n, :n], C[:, :n]) for n in wanted]
    return gathered("next_era", recording, order, plan, singular_values, models)
