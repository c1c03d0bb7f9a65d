"""Natural excitation technique: correlations of random responses, realized as if they were free decays.

Under white excitation the covariances R_k, k >= 1, are free decays of the structure, one for each reference.
R_0 is not: it carries the noise of the sensors, and stays out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from identification.covariance import output_covariances, reference_rows
from identification.era import era
from identification.output_only import plan_hankel
from identification.recording import Recording
from identification.ssi import balance
from identification.systems import MarkovParameters, Realization, StateSpace

MAX_COLUMNS = 500


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
        references: names of the reference outputs, each of which gives a column of free decays; all when
            None.

    Returns:
        The models, without inputs, and all singular values.

    Raises:
        OrderError: an order below 1, or above what the Hankel matrix can carry.
        TooShortError: the record has fewer samples than lags.
        RecordingError: a reference does not exist, or a sample is missing.

    Source: James, Carne and Lauffer (1995), Int. J. Anal. Exp. Modal Anal. 10(4), 260-277; realized as in
        Juang and Pappa (1985), J. Guidance 8(5).
    """
    rows = reference_rows(recording, references)
    plan = plan_hankel(recording, order, orders, n_rows, rows.size)
    n_columns = max(min(plan.n_rows, MAX_COLUMNS // rows.size), -(-plan.orders[-1] // rows.size))
    R = output_covariances(recording, plan.n_rows + n_columns, references=references)
    scale = balance(R, recording, rows)  # (n_outputs, 1)
    decays = MarkovParameters(
        np.concatenate([np.zeros((1, *R.shape[1:])), R]),
        recording.dt,
        tuple(recording.outputs[row] for row in rows),
        recording.outputs,
    )
    found = era(decays, plan.orders[-1], orders=plan.orders, n_rows=plan.n_rows, n_columns=n_columns)
    notes = plan.notes
    if order is None:
        order = _steepest_drop(found)
        notes += (f"The singular values drop most steeply after the first {order}.",)
    systems = tuple(
        StateSpace(
            system.A,
            system.B[:, :0],
            scale * system.C,
            system.D[:, :0],
            recording.dt,
            (),
            recording.outputs,
        )
        for system in found.systems
    )
    settings = {**found.settings, "n_references": rows.size}
    return replace(found, method="next_era", systems=systems, order=order, settings=settings, notes=notes)


def _steepest_drop(realization: Realization) -> int:
    """The order after which the singular values fall by the largest factor."""
    s = np.append(realization.singular_values, 0)
    n = np.array(realization.orders)
    return int(n[np.argmax(s[n - 1] / np.maximum(s[n], np.finfo(float).eps * s[0]))])
