"""Observer identification: Markov parameters of a structure under general forces, from any initial motion.

The next output is predicted from the last inputs and outputs. Such a predictor forgets how the record
began, so a record may start in motion; the Markov parameters follow from its coefficients by recursion.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from identification.era import era
from identification.input_fit import fit_inputs
from identification.observer import Observer, observe
from identification.recording import Recording
from identification.systems import MarkovParameters, Realization, StateSpace


def okid(recording: Recording, *, n_lags: int | None = None, observer: int | None = None) -> MarkovParameters:
    """Markov parameters from recorded inputs and outputs, whatever the inputs and the initial state.

    Args:
        recording: one or more records with inputs; records of kind pulse or impact are taken to start
            from rest.
        n_lags: number of Markov parameters; four times the length of the observer and one when None.
        observer: samples that the observer looks back; chosen from the data when None.

    Returns:
        D, CB, CAB, …, shape (n_lags, n_outputs, n_inputs).

    Raises:
        RecordingError: no inputs, a missing sample, or a channel that is zero throughout.
        TooShortError: too few samples.

    Source: Juang, Phan, Horta and Longman (1993), J. Guidance 16(2), 320-329: the recursion from observer to
        system Markov parameters, Y_k = beta_k + Σ alpha_i Y_(k-i), i = 1 … min(k, p), with beta_k = 0 for k > p.
    """
    found = observe(recording, observer=observer)
    Y = found.markov(4 * found.length + 1 if n_lags is None else n_lags)
    values = Y * found.output_rms[:, None] / found.input_rms
    return MarkovParameters(values, recording.dt, recording.inputs, recording.outputs)


def okid_era(
    recording: Recording,
    order: int | None = None,
    *,
    observer: int | None = None,
    n_lags: int | None = None,
    form: str = "balanced",
    orders: Iterable[int] | None = None,
) -> Realization:
    """State space from recorded inputs and outputs: observer, Markov parameters, realization, B and D anew.

    Args:
        recording: as for `okid`.
        order: number of states; chosen from the singular values when None.
        observer: as for `okid`.
        n_lags: as for `okid`.
        form: as for `era`, in channels scaled to unit RMS.
        orders: further orders to realize; B and D are fitted to the recording at `order` only.

    Returns:
        Models of all orders, and the singular values of the Hankel matrix of scaled Markov parameters.

    Raises:
        RecordingError: as for `okid`.
        TooShortError: as for `okid`.
        OrderError: an order exceeds what the observer can hold.

    Source: Juang, Phan, Horta and Longman (1993), J. Guidance 16(2), 320-329: the observer y(k) = D u(k) +
        Σ beta_i u(k-i) + Σ alpha_i y(k-i), its Markov parameters as for `okid`, and their realization as in
        Juang (1992), thesis, eq. (3.10), (3.15), (3.20).
    """
    found = observe(recording, observer=observer)
    raw = realize(found, recording, order, n_lags=n_lags, form=form, orders=orders)
    return with_fitted_inputs(raw, recording)


def realize(
    found: Observer,
    recording: Recording,
    order: int | None,
    *,
    n_lags: int | None,
    form: str,
    orders: Iterable[int] | None,
) -> Realization:
    """State space from an observer, with B and D as the observer has them.

    Args:
        found: the observer.
        recording: what it observed.
        order: as for `okid_era`.
        n_lags: likewise.
        form: likewise.
        orders: likewise.

    Returns:
        Models of all orders.

    Raises:
        OrderError: an order exceeds what the observer can hold.

    Source: as for `okid_era`.
    """
    p = found.length
    n_lags = 4 * p + 1 if n_lags is None else n_lags
    Y = MarkovParameters(found.markov(n_lags), recording.dt, recording.inputs, recording.outputs)
    notes: tuple[str, ...] = (found.note,)
    if order is None:
        # Later lags only repeat what the observer holds, so noise would look like its many states.
        shown = min(n_lags, 2 * p + 1 if found.exact or p < 40 else p + 1)
        start = era(replace(Y, values=Y.values[:shown]))
        order, notes = start.order, (*notes, *start.notes)
    raw = era(Y, order, form=form, orders=orders)
    systems = tuple(_unscaled(system, found) for system in raw.systems)
    settings = {"observer": p, "n_lags": n_lags} | raw.settings
    return replace(raw, method="okid_era", systems=systems, settings=settings, notes=notes)


def _unscaled(system: StateSpace, found: Observer) -> StateSpace:
    return replace(
        system,
        B=system.B / found.input_rms,
        C=system.C * found.output_rms[:, None],
        D=system.D * found.output_rms[:, None] / found.input_rms,
    )


def with_fitted_inputs(realized: Realization, recording: Recording) -> Realization:
    """The realization with B and D of the chosen order fitted to the recording, unless that order has an unstable pole.

    Args:
        realized: by `realize`.
        recording: what it was realized from.

    Returns:
        The other orders as they are.

    Source: Ljung (1999), System Identification, 2nd ed., section 10.6: with A and C known, the outputs are linear in B and D.
    """
    longest = max(record.n_samples for record in recording.records)
    radius = np.max(np.abs(np.linalg.eigvals(realized.system.A)))
    if longest * np.log(radius) > 3:
        note = "B and D are those of the observer, since an unstable pole forbids a simulation of the whole record."
        return replace(realized, notes=(*realized.notes, note))
    fitted = fit_inputs(realized.system, recording)
    systems = tuple(fitted if system.n_states == realized.order else system for system in realized.systems)
    return replace(realized, systems=systems)
