"""Poly-reference least-squares complex frequency method: state-space models from frequency responses.

A polynomial denominator shared by all outputs gives poles and participation factors (`denominator`); with
these known, outputs and direct term follow by linear least squares over the lines (`lsfd`).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.circle import Circle, all_lines, model_points
from identification.denominator import coefficients, reduced_factor, zeros
from identification.errors import OrderError, TooShortError
from identification.lsfd import fit_outputs, line_weights
from identification.modal_form import modal_gains, modal_states, widths
from identification.recording import Array
from identification.response import FrequencyResponse
from identification.spectra import unit_sizes
from identification.systems import Realization, StateSpace

Complex = NDArray[np.complex128]

MAX_ORDER = 120
MAX_DEGREE = 32
MAX_LINES = 1024


def plscf(
    response: FrequencyResponse,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    degree: int | None = None,
    band: tuple[float, float] | None = None,
) -> Realization:
    """State space whose frequency response fits the measured one, by a polynomial denominator.

    With n inputs, a denominator of degree p has p n poles. Asked for an order, the model keeps the poles of
    the highest degree that contribute most to the response; asked for none, there is a model with all poles
    of each degree, to tell the structure's own poles by their staying put. Poles outside the unit circle
    belong to the noise; the fit needs them as residual terms, a simulation does not bear them.

    Calculated responses show their order, and their poles come out exact when all lines up to half the
    sample rate are used. For measured ones a band not much wider than the resonances is best: within a
    band, z turns by half a circle from its lower to its upper edge, and a degree then spans more time.

    Args:
        response: to forces held over each sample, or that vary continuously (`dt` is zero, as an analyser measures
            it), or positive spectra of outputs.
        order: number of states kept; chosen from the data when None.
        orders: further orders, multiples of the number of inputs when `order` is None.
        degree: highest degree p; what the lines and `MAX_ORDER` allow, at most `MAX_DEGREE`, when None.
        band: lowest and highest frequency fitted [Hz]; all lines and the whole circle when None.

    Returns:
        Models of all orders, sampled like the response or continuous, and the singular values of the reduced
        equations, which tell the rank of data without noise.

    Raises:
        OrderError: more states than the polynomial has zeros, or an order that cannot be had.
        TooShortError: fewer lines than the degree needs.
        IdentificationError: no line lies in the band.

    Source: Guillaume, Verboven, Vanlanduit, Van der Auweraer and Peeters (2003), Proc. 21st IMAC; Peeters,
        Van der Auweraer, Guillaume and Leuridan (2004), Shock Vib. 11, 395-409: H = N D⁻¹ with polynomials in z, by
        least Σ |w (N_o - H_o D)|² over lines and outputs o; the poles are the zeros of det D.
    """
    circle = Circle(response.dt, *(all_lines(response) if band is None else band))
    if band is not None:
        response = response.between(*band)
    n_f, _, n_inputs = response.values.shape
    asked = [*(orders or ()), *(() if order is None else (order,))]
    p = _highest_degree(n_f, n_inputs, degree, asked)
    R, size = _reduced(response, circle, p)
    singular_values = scipy.linalg.svdvals(R[:, :-n_inputs])
    settings: dict[str, int | float | str] = {"degree": p, "low_hz": circle.low, "high_hz": circle.high}
    notes: tuple[str, ...] = ()
    if not asked and band is None and response.dt and (rank := _rank(R, n_inputs)):
        asked, order = [rank], rank
        notes = (f"Order {rank} is the rank of the equations, whose singular values end in rounding errors.",)
    settings["poles"] = "all" if order is None else "strongest"
    if order is None:
        degrees = _degrees(asked, n_inputs, p)
        fits = [_fit(response, circle, *zeros(coefficients(R, n_inputs, q))) for q in degrees]
        order, note = _shortest_description(fits, 2 * n_f * n_inputs, size)
        notes = (note,)
    else:
        candidates = zeros(coefficients(R, n_inputs, p))
        fits = [
            _fit(response, circle, *_strongest(response, circle, *candidates, n)) for n in sorted({*asked})
        ]
    systems = tuple(_unwindowed(fit.system, response.decay) for fit in fits)
    return Realization("plscf", systems, singular_values, order, settings, notes)


def response_rank(response: FrequencyResponse) -> int | None:
    """Number of states that calculated responses show; None for measured ones, which have noise.

    The singular values of the reduced equations fall off a cliff, and as many zeros of the denominator as
    stand above it, and no more, lie inside the unit circle.

    Args:
        response: to forces, or positive spectra.

    Returns:
        Number of states or None.
    """
    thin = response.take(slice(None, None, -(-response.frequency_hz.size // MAX_LINES)))  # any lines show it
    n_f, _, n_inputs = thin.values.shape
    if n_f < 4 or not thin.dt:
        return None
    R, _ = _reduced(thin, Circle(thin.dt, 0.0, 0.5 / thin.dt), _highest_degree(n_f, n_inputs, None, []))
    return _rank(R, n_inputs)


def _reduced(response: FrequencyResponse, circle: Circle, degree: int) -> tuple[Array, Array]:
    """The reduced equations, outputs of different units on one scale, and that scale, (n_outputs,)."""
    size = unit_sizes(np.sum(np.abs(response.values) ** 2, axis=(0, 2)), response.outputs)
    weight = line_weights(response)[:, None] / size
    return reduced_factor(response.values, circle.points(response.frequency_hz), weight, degree), size


class _Fit(NamedTuple):
    """A model, and what it leaves of each output."""

    system: StateSpace
    misfit: Array


def _fit(response: FrequencyResponse, circle: Circle, zeros: Complex, participation: Complex) -> _Fit:
    """Model with the given zeros of the denominator as poles, and the outputs that fit best."""
    z, points = circle.poles(zeros), model_points(response)
    A, B = modal_states(z, participation)
    C, D, misfit = fit_outputs(response, modal_gains(z, participation, points))
    return _Fit(StateSpace(A, B, C, D, response.dt, response.inputs, response.outputs), misfit)


def _strongest(
    response: FrequencyResponse, circle: Circle, zeros: Complex, participation: Complex, order: int
) -> tuple[Complex, Complex]:
    """The decaying poles, `order` states in all, that contribute most to the response."""
    system = _fit(response, circle, zeros, participation).system
    width, z = widths(zeros), circle.poles(zeros)
    decaying = circle.decaying(z)
    first = np.cumsum(width) - width
    shape = np.add.reduceat(np.sum(system.C**2, axis=0), first)  # (n_poles,)
    gain = np.mean(1 / np.abs(model_points(response)[:, None] - z) ** 2, axis=0) * np.sum(
        np.abs(participation) ** 2, axis=1
    )
    chosen: list[int] = []
    left = order
    for k in np.argsort(-shape * gain, kind="stable"):
        if decaying[k] and width[k] <= left:
            chosen.append(int(k))
            left -= int(width[k])
    if left:
        n_decaying = int(np.sum(width[decaying]))
        raise OrderError(
            f"order {order} cannot be made of the {n_decaying} states that decay; "
            "take a lower or an even order, or a higher degree"
        )
    return zeros[chosen], participation[chosen]


def _highest_degree(n_f: int, n_inputs: int, degree: int | None, asked: list[int]) -> int:
    """The degree asked for, or the highest that the lines can carry, within bounds."""
    wanted = max(asked, default=1)
    if min(asked, default=1) < 1:
        raise OrderError(f"order {min(asked)} was asked for; expected at least 1")
    if degree is None:
        needed = -(-wanted // n_inputs)
        degree = max(default_degree(n_f, n_inputs), needed)
    if degree + 1 > n_f:
        raise TooShortError(
            f"{n_f} lines cannot carry polynomials of degree {degree}; widen the band, take longer pieces "
            "(n_segment) or a lower order"
        )
    if wanted > degree * n_inputs:
        raise OrderError(
            f"order {wanted} exceeds {degree * n_inputs}, the poles of a polynomial of degree {degree} with "
            f"{n_inputs} inputs; lower the order or raise the degree"
        )
    return degree


def default_degree(n_lines: int, n_inputs: int) -> int:
    """Highest degree that lines and bounds allow.

    Args:
        n_lines: lines fitted.
        n_inputs: inputs, or references.

    Returns:
        At least 1.
    """
    return max(min(MAX_DEGREE, MAX_ORDER // n_inputs, n_lines // 2), 1)


def _degrees(orders: list[int], n_inputs: int, highest: int) -> list[int]:
    """Degrees of the orders asked for; all when none is."""
    odd = [n for n in orders if n % n_inputs]
    if odd:
        raise OrderError(
            f"order {odd[0]} is no multiple of the {n_inputs} inputs, as the poles of a polynomial are; "
            "ask for it by `order`, which keeps the strongest poles"
        )
    return sorted({n // n_inputs for n in orders}) or list(range(1, highest + 1))


def _rank(R: Array, n_inputs: int) -> int | None:
    s = scipy.linalg.svdvals(R[:, :-n_inputs])
    floor = np.maximum(s, np.finfo(float).eps * s.size * s[0])
    cliffs = np.flatnonzero((floor[:-1] >= 1e3 * floor[1:]) & (floor[1:] <= 1e-8 * floor[0]))
    if not cliffs.size:
        return None
    rank = int(cliffs[-1]) + 1
    z, _ = zeros(coefficients(R, n_inputs, R.shape[1] // n_inputs - 1))
    return rank if np.sum(widths(z)[np.abs(z) < 1]) == rank else None


def _shortest_description(fits: list[_Fit], n_values: int, size: Array) -> tuple[int, str]:
    """The order with the least misfit for its number of parameters, and the reason.

    Source: Rissanen (1978), Automatica 14, 465-471: N log(misfit) + parameters · log N.
    """
    lengths = []
    for system, misfit in fits:
        power = max(float(np.mean(misfit / size**2)), np.finfo(float).tiny)
        n_parameters = system.n_states * (len(system.inputs) + len(system.outputs))
        lengths.append(n_values * size.size * np.log(power) + n_parameters * np.log(n_values * size.size))
    order = fits[int(np.argmin(lengths))].system.n_states
    return order, f"Order {order} describes the responses shortest: a higher one gains less than it costs."


def _unwindowed(system: StateSpace, decay: float) -> StateSpace:
    """The model without the exponential window: z → z exp(decay dt), or s → s + decay."""
    if not system.dt:
        shifted = system.A + decay * np.eye(system.n_states)
        return StateSpace(shifted, system.B, system.C, system.D, 0.0, system.inputs, system.outputs)
    growth = np.exp(decay * system.dt)
    return StateSpace(
        growth * system.A, growth * system.B, system.C, system.D, system.dt, system.inputs, system.outputs
    )
