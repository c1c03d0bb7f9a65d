"""Error bars of modes from frequency responses alone: the noise of their lines drawn anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.plscf import plscf
from identification.recording import Array
from identification.residual_scatter import DRAWS, scatter_of
from identification.response import FrequencyResponse
from identification.spectral_scatter import ModeErrorBars, Tracks, values_near
from identification.systems import Realization

Complex = NDArray[np.complex128]

NEIGHBOURS = 20
"""Lines on either side over which the power of what the model leaves is averaged."""


def line_scatter(
    response: FrequencyResponse,
    realization: Realization,
    tracks: Tracks,
    *,
    band: tuple[float, float] | None = None,
) -> ModeErrorBars:
    """Standard deviations of frequencies and damping ratios, with what noise shifts on average in the latter.

    Each line of the model gets complex noise of the variance that the responses state, or else of the power that the
    model leaves nearby; everything that was chosen in the analysis is held fixed.

    Args:
        response: the one that was realized.
        realization: by `plscf`.
        tracks: where the modes stand among its models.
        band: as given to `plscf`.

    Returns:
        All three.

    Raises:
        IdentificationError: the modes do not come back when the analysis is repeated.

    Source: parametric bootstrap, Efron and Tibshirani (1993), section 6.5.
    """
    if band is not None:
        response = response.between(*band)
    orders = np.unique(tracks.orders).tolist()
    strongest = realization.settings["poles"] == "strongest"
    degree = int(realization.settings["degree"])
    n = len(np.unique(tracks.mode))

    def estimate(values: Complex) -> Array:
        again = replace(response, values=values)
        try:
            found = plscf(again, orders[-1] if strongest else None, orders=orders, degree=degree, band=band)
            modes = tracks.modes(found)
        except IdentificationError:  # too few poles of that draw decay
            modes = None
        return (
            np.full(2 * n, np.nan) if modes is None else np.hstack([modes.frequency_hz, modes.damping_ratio])
        )

    model = realization.at(orders[-1])
    windowed = response.frequency_hz - 1j * response.decay / (2 * np.pi)
    clean = model.frequency_response(windowed)  # type: ignore[arg-type]
    spread = noise_std(response, clean, model.n_states)
    truth = values_near(_poles(tracks, n), model.modes())
    rng = np.random.default_rng(0)
    draws = []
    for _ in range(DRAWS):
        noise = rng.standard_normal(clean.shape) + 1j * rng.standard_normal(clean.shape)
        draws.append(estimate(clean + spread * noise / np.sqrt(2)))
    std, shift = scatter_of(np.array(draws), truth)
    if not np.any(np.isfinite(std)):
        raise IdentificationError(
            "the modes do not come back when the analysis is repeated; take another order"
        )
    return ModeErrorBars(std[:n], std[n:], shift[n:])


def noise_std(response: FrequencyResponse, clean: Complex, n_states: int) -> Array:
    """Standard deviation of every value: as the responses state, else as their model leaves on neighbouring lines.

    Args:
        response: with its variance or without.
        clean: what the model makes of it, shape (n_frequencies, n_outputs, n_inputs).
        n_states: of the model, which absorbs some of the noise.

    Returns:
        Shape (n_frequencies, n_outputs, n_inputs).

    Source: Brillinger (1981), Time Series, section 5.4, the smoothed periodogram of what is left.
    """
    if response.variance is not None and np.all(response.variance > 0):
        return np.sqrt(response.variance)
    n_f, n_outputs, n_inputs = clean.shape
    power = np.abs(response.values - clean) ** 2
    window = np.ones(min(2 * NEIGHBOURS + 1, n_f))
    counts = np.convolve(np.ones(n_f), window, "same")[:, None, None]
    smooth = np.apply_along_axis(lambda column: np.convolve(column, window, "same"), 0, power) / counts
    n_values, n_unknowns = 2 * n_f * n_outputs * n_inputs, n_states * (n_outputs + n_inputs)
    return np.asarray(np.sqrt(smooth / max(1 - n_unknowns / n_values, 1 / n_values)))


def _poles(tracks: Tracks, n: int) -> Complex:
    """One pole of each mode: the mean of those behind it, shape (n_modes,)."""
    numbers = np.unique(tracks.mode)
    return np.array([np.mean(tracks.poles[tracks.mode == k]) for k in numbers[:n]])
