"""From a recording to models by way of its spectra: what `plscf` is given, and the choices made on the way."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg

from identification.errors import TooShortError
from identification.horizon import resonance_peaks
from identification.local_response import local_response
from identification.peaks import find_peaks
from identification.plscf import default_degree, plscf, response_rank
from identification.recording import Recording
from identification.response import FrequencyResponse
from identification.segments import choose_segments
from identification.spectra import (
    cross_spectra,
    frequency_response,
    positive_spectra,
    unit_sizes,
)
from identification.systems import Realization

LEFT = {"measured": 1e-3, "calculated": 1e-12}
"""Share of its height to which an exponential window falls by the end of the response to a blow."""

PERIODS = 8
"""Periods of the lowest resonance that the output correlations last, unless told otherwise."""

FALL = 3.0
"""By how much the power falls behind a resonance."""

LINE_VALUES = 60
"""Squared responses averaged to tell a resonance from chance."""

MARGIN = 2.0
"""Upper edge of the band fitted, over the frequency of the highest peak and over that where it has faded."""

LINES_PER_POLE = 5
"""Fewest measured lines for each oscillating pole of the highest degree, unless told otherwise: noise is alike at
neighbouring lines, and with more poles it splits those of the structure in two."""

MAX_REFERENCES = 8
"""Outputs taken as references unless told otherwise; more of them leave a lower degree to each."""


def plscf_recording(
    recording: Recording,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    degree: int | None = None,
    band: tuple[float, float] | None = None,
    estimator: str = "H1",
    n_segment: int | None = None,
    decay: float | None = None,
    references: Sequence[str] | None = None,
    n_lags: int | None = None,
) -> Realization:
    """Poly-reference least-squares complex frequency models of a recording, with or without measured forces.

    With forces the frequency responses are fitted, without them the positive spectra of the outputs, whose
    models have no inputs. What is None is chosen from the data, with the reason in the notes.

    Args:
        recording: any kind of records.
        order: number of states; all degrees are tried when None.
        orders: as for `plscf`.
        degree: as for `plscf`; with forces, when None, low enough for `LINES_PER_POLE`.
        band: lowest and highest frequency fitted [Hz]; `resonance_band` when None, and all lines when the data
            are free of noise.
        estimator: as for `frequency_response`; of no account without forces. Random records with H1 go through
            `local_response`, which does not leak, unless `n_segment` is given.
        n_segment: likewise.
        decay: rate of the exponential window [1/s], which is undone in the models.
        references: names of the reference outputs; of no account with forces. When None all, or eight that see
            most of the motion.
        n_lags: lags of the output correlations; likewise.

    Returns:
        Models of all orders, with the choices made in the notes.

    Raises:
        IdentificationError: as for `frequency_response`, `positive_spectra` and `plscf`.

    Source: as for `plscf`; for outputs alone, with `positive_spectra` in the place of H, Peeters and Van der Auweraer
        (2005), Proc. 1st IOMAC, section 3.
    """
    orders = None if orders is None else list(orders)
    forced = bool(recording.inputs) and all(record.inputs.shape[0] for record in recording.records)
    if forced:
        response, why = _forced_response(recording, estimator, n_segment, decay), "as asked for"
        if response_rank(response) is None:
            if band is None:
                band, why = resonance_band(response), "no resonance lies above"
            if degree is None:
                inside = response if band is None else response.between(*band)
                degree = _sparse_degree(inside, [*(orders or ()), *(() if order is None else (order,))])
    else:
        peaks = resonance_peaks(recording)
        response, why = _output_response(recording, peaks, references, n_lags, decay), "as asked for"
        if band is None:
            band, why = _peak_band(response, peaks)
    notes = response.notes
    if band is not None:
        notes = (*notes, f"Lines from {band[0]:.4g} to {band[1]:.4g} Hz are fitted: {why}.")
    found = plscf(response, order, orders=orders, degree=degree, band=band)
    settings = {**found.settings, "decay": response.decay}
    if forced:
        return replace(found, settings={**settings, "estimator": estimator}, notes=(*notes, *found.notes))
    systems = tuple(
        replace(system, B=system.B[:, :0], D=system.D[:, :0], inputs=()) for system in found.systems
    )
    settings |= {
        "n_references": len(response.inputs),
        "n_lags": round(1 / (response.frequency_hz[1] * recording.dt)),
    }
    return replace(found, systems=systems, settings=settings, notes=(*notes, *found.notes))


def _sparse_degree(response: FrequencyResponse, orders: Sequence[int]) -> int:
    """Highest degree with `LINES_PER_POLE`, or what the orders asked for need."""
    n_lines, n_inputs = response.frequency_hz.size, len(response.inputs)
    sparse = max(2 * n_lines // (LINES_PER_POLE * n_inputs), 1)
    return max(min(default_degree(n_lines, n_inputs), sparse), -(-max(orders, default=1) // n_inputs))


def _forced_response(
    recording: Recording, estimator: str, n_segment: int | None, decay: float | None
) -> FrequencyResponse:
    """Frequency responses: by local models of random records, else of whole records or periods.

    An exponential window is put on where a blow is all that drives the structure.
    """
    if decay is not None:
        return frequency_response(recording, estimator, n_segment=n_segment, decay=decay)
    if estimator == "H1" and n_segment is None and choose_segments(recording).kind == "stationary":
        try:
            return local_response(recording)
        except TooShortError:  # a few pieces under a window must do
            return frequency_response(recording, estimator)
    response = frequency_response(recording, estimator, n_segment=n_segment)
    blows = {record.kind for record in recording.records} <= {"pulse", "impact"}
    if not blows or n_segment is not None or response.n_averages < len(recording.inputs):
        return response
    left = LEFT["calculated" if response_rank(response) else "measured"]
    duration = max(record.n_samples for record in recording.records) * recording.dt
    windowed = frequency_response(recording, estimator, decay=-np.log(left) / duration)
    note = (
        f"An exponential window that falls to {left:g} makes all motion end within the record; it is undone."
    )
    return replace(windowed, notes=(*windowed.notes, note))


def _output_response(
    recording: Recording,
    peaks: Sequence[float],
    references: Sequence[str] | None,
    n_lags: int | None,
    decay: float | None,
) -> FrequencyResponse:
    """Positive spectra of a few periods of the lowest resonance, under an exponential window."""
    notes: tuple[str, ...] = ()
    if n_lags is None:
        longest = max(record.n_samples for record in recording.records)
        wanted = PERIODS * recording.sample_rate / peaks[0] if peaks else longest / 16
        n_lags = max(int(min(max(wanted, 64), longest / 4)), 2)
        why = (
            f"about {PERIODS} periods of the lowest resonance peak, at {peaks[0]:.4g} Hz"
            if peaks
            else "no peak"
        )
        notes = (f"The output correlations are taken over {n_lags} lags: {why}.",)
    if decay is None:
        decay = 4.0 / (n_lags * recording.dt)
        notes = (*notes, "An exponential window takes them down to 2 % at the last lag; it is undone.")
    if references is None and len(recording.outputs) > MAX_REFERENCES:
        references = spread_references(recording, MAX_REFERENCES)
        notes = (
            *notes,
            f"The references are {', '.join(references)}, which together see most of the motion.",
        )
    response = positive_spectra(recording, n_lags, references=references, decay=decay)
    return replace(response, notes=notes)


def spread_references(recording: Recording, n: int) -> tuple[str, ...]:
    """Names of the n outputs whose cross-spectra with all outputs leave least of the others unexplained.

    Args:
        recording: whose outputs they are.
        n: how many.

    Returns:
        The one that sees most first.

    Source: Businger and Golub (1965), Numer. Math. 7, 269-276, the pivots of an orthogonal factorization.
    """
    spectra = cross_spectra(recording)
    size = unit_sizes(np.einsum("foo->o", spectra.values).real, recording.outputs)
    G = spectra.values / size[:, None] / size
    _, pivots = scipy.linalg.qr(G.reshape(-1, size.size), mode="r", pivoting=True)
    return tuple(recording.outputs[k].name for k in pivots[:n])


def resonance_band(response: FrequencyResponse) -> tuple[float, float] | None:
    """From zero to well above the resonances, or all lines (None) where they reach up to half the sample rate.

    The power of all responses is averaged over so many lines that its scatter is below a tenth. It falls
    from the last resonance by a factor of three; twice the frequency where it does is the upper edge.

    Args:
        response: to forces, or positive spectra.

    Returns:
        Lowest and highest frequency [Hz], or None.
    """
    f, nyquist = response.frequency_hz, 0.5 / response.dt
    low = 0.0 if f[0] < 0.1 * f[-1] else float(f[0])
    high = min(MARGIN * _last_fall(response), float(f[-1]))
    return None if high > 0.8 * nyquist and low == 0 else (low, high)


def _peak_band(response: FrequencyResponse, peaks: Sequence[float]) -> tuple[tuple[float, float] | None, str]:
    """From zero to above the resonance peaks, as far as the lowest one can be told from drift; and the reason.

    A degree spans a sample of twice the upper edge, and half a period of the lowest resonance takes as many
    of them as the edge is higher than it.
    """
    faded, nyquist = resonance_band(response), 0.5 / response.dt
    if not peaks:
        return faded, "no resonance lies above"
    wanted = max(MARGIN * peaks[-1], nyquist if faded is None else faded[1])
    reach = default_degree(response.frequency_hz.size, len(response.inputs)) * peaks[0]
    high = min(wanted, reach)
    if high > 0.8 * nyquist:
        return None, ""
    if high < 1.1 * peaks[-1]:
        return (0.0, high), (
            f"the polynomial does not reach further from the peak at {peaks[0]:.4g} Hz; for the peaks up to "
            f"{peaks[-1]:.4g} Hz give another `band`"
        )
    return (0.0, high), "no resonance lies above"


def _last_fall(response: FrequencyResponse) -> float:
    """Frequency by which the averaged power has fallen by a factor of three from its last peak [Hz]."""
    size = unit_sizes(np.sum(np.abs(response.values) ** 2, axis=(0, 2)), response.outputs)
    power = np.sum(np.abs(response.values / size[:, None]) ** 2, axis=(1, 2))
    n_f, n_outputs, n_inputs = response.values.shape
    m = min(-(-LINE_VALUES // (n_outputs * n_inputs)), max(n_f // 8, 1))
    n = n_f // m
    means = np.mean(power[: n * m].reshape(n, m), axis=1)
    found = find_peaks(means, FALL, from_start=True)
    last = found[-1].fall if found else n - 1
    return float(response.frequency_hz[(last + 1) * m - 1])
