"""Methods that realize the responses to unit pulses, or free decays, at every order: from a recording to its models."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from identification.era import decompose, era, era_dc, hankel_size, settle_orders
from identification.pulse import markov_parameters
from identification.recording import Recording
from identification.systems import MarkovParameters, Realization
from identification.time_domain import itd, mmrtd_real, mrtd_real

ITD_ROWS = 120
"""Rows of the matrix whose eigenvectors are Ibrahim's modes, unless told otherwise; the work grows with their cube."""


def itd_real(
    markov: MarkovParameters,
    order: int | None = None,
    *,
    n_rows: int | None = None,
    n_columns: int | None = None,
    orders: Iterable[int] | None = None,
) -> Realization:
    """State space in real modal coordinates by `itd`, at every order.

    Args:
        markov: D, CB, CAB, …, shape (n_lags, n_outputs, n_inputs).
        order: number of states; chosen from the singular values when None.
        n_rows: as for `era`; what makes about `ITD_ROWS` rows when None.
        n_columns: as for `era`.
        orders: further orders to realize.

    Returns:
        Models of all orders asked for, and all singular values of H(0).

    Raises:
        OrderError: an order exceeds the numerical rank.
        TooShortError: too few lags.

    Source: Juang (1992), thesis, eq. (4.8) to (4.11), (C.2) to (C.4).
    """
    if n_rows is None and n_columns is None:
        n_rows = max(1, min(-(-ITD_ROWS // max(len(markov.outputs), 1)), (markov.n_lags - 1) // 2))
    n_rows, n_columns = hankel_size(markov, n_rows, n_columns)
    H = decompose(markov, n_rows, n_columns)
    order, wanted, notes = settle_orders(markov, H, order, orders)
    systems = tuple(itd(markov, n, n_rows=n_rows, n_columns=n_columns).real() for n in wanted)
    return Realization("itd", systems, H.S, order, {"n_rows": n_rows, "n_columns": n_columns}, notes)


MARKOV_METHODS: dict[str, Callable[..., Realization]] = {
    "era": era,
    "era_dc": era_dc,
    "itd": itd_real,
    "mrtd": mrtd_real,
    "mmrtd": mmrtd_real,
}
"""Name -> function(markov, order, *, orders, …) -> Realization."""


def realize_pulses(
    name: str,
    recording: Recording,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    **settings: Any,
) -> Realization:
    """Models from unit pulses or free decays: `markov_parameters`, then a method of `MARKOV_METHODS` at every order.

    Args:
        name: of the method.
        recording: records of kind `pulse` or `free_decay`.
        order: number of states; chosen from the singular values when None.
        orders: further orders; when both are None and there is noise, up to twice the order chosen.
        settings: as for the method.

    Returns:
        Models of all orders, and the singular values that tell the order.

    Raises:
        RecordingError: the records are neither pulses nor free decays.
        OrderError: an order exceeds the rank of the data.

    Source: as for `markov_parameters`, and that of the method.
    """
    markov = markov_parameters(recording)

    def realize(order: int | None, orders: Iterable[int] | None) -> Realization:
        found = MARKOV_METHODS[name](markov, order, orders=orders, **settings)
        return replace(found, method=name)

    return around_the_order(realize, order, orders)


def around_the_order(
    realize: Callable[[int | None, Iterable[int] | None], Realization],
    order: int | None,
    orders: Iterable[int] | None,
) -> Realization:
    """Models of the orders asked for, or of the order that the data show and a sweep around it.

    Args:
        realize: function of an order and further orders.
        order: as asked; None to choose.
        orders: likewise.

    Returns:
        What `realize` gives.
    """
    found = realize(order, orders)
    if order is not None or orders is not None or shows_rank(found):
        return found
    highest = min(max(2 * found.order, found.order + 6), found.singular_values.size)
    swept = realize(found.order, range(2, highest + 1, 2))
    return replace(swept, notes=(*found.notes, f"Orders 2, 4, … {highest} tell whether its modes stay put."))


def shows_rank(realization: Realization) -> bool:
    """Whether the data are calculated ones, whose singular values end in rounding errors after the order.

    The best converters resolve 24 bits, 6e-8 of their range; nothing measured falls by a factor of 1000 to
    below 1e-8.

    Args:
        realization: with its singular values.

    Returns:
        True for data without noise.
    """
    s, n = realization.singular_values, realization.order
    return bool(n < s.size and s[n] <= 1e-8 * s[0] and s[n - 1] >= 1e3 * s[n])
