"""Error bars of modes whose method works on spectra: `plscf` and `efdd`.

- `plscf` with measured forces: the noise that the model leaves, redrawn (`residual_scatter`).
- `plscf` of outputs alone: parts of the record left out in turn (`resampling`).
- `efdd`: groups of the pieces behind the averaged spectra left out in turn.

The data are analysed anew each time with everything that was chosen held fixed: band, degree, window, lags, pieces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from identification.clusters import Indices, Poles, cluster_means
from identification.errors import IdentificationError, TooShortError
from identification.fdd import decomposition
from identification.forced_model import forced_model
from identification.frequency_domain import spread_references
from identification.methods import find_method
from identification.modes import Complex, Modes
from identification.progress import UNHEARD, Work
from identification.recording import Array, Recording
from identification.resampling import jackknife_std, spread_of_parts
from identification.residual_scatter import residual_scatter
from identification.spectra import cross_spectra
from identification.stability import Stabilization
from identification.systems import Realization

SPECTRAL = ("plscf", "efdd")
"""Methods served here."""

GROUPS = 20
"""Groups of pieces left out in turn."""

MAX_ORDERS = 8
"""Orders looked at again; the poles of one mode at neighbouring orders move nearly alike."""

LOST = 0.2
"""Relative distance beyond which the nearest pole is another one."""


class ModeErrorBars(NamedTuple):
    """Error bars of modes.

    Attributes:
        frequency: one standard deviation [Hz], shape (n_modes,); infinite where a mode is lost.
        damping: of the damping ratio, likewise.
        damping_shift: what noise adds to the damping ratio on average, and `damping` counts, shape (n_modes,); NaN where
            it is not known.
    """

    frequency: Array
    damping: Array
    damping_shift: Array


@dataclass(frozen=True, eq=False)
class Tracks:
    """Which poles of which models the modes are the means of.

    Attributes:
        orders: of the model of each pole, rising, shape (n_poles,).
        poles: continuous in time [rad/s], shape (n_poles,).
        mode: number of the mode that each pole belongs to, shape (n_poles,).
    """

    orders: Indices
    poles: Complex
    mode: Indices

    @classmethod
    def of_modes(cls, modes: Modes, order: int) -> Tracks:
        """Modes of one model."""
        return cls(np.full(len(modes), order), modes.poles, np.arange(len(modes)))

    @classmethod
    def of_places(cls, places: Sequence[tuple[int, complex]]) -> Tracks:
        """One order and pole for each mode."""
        orders = np.array([order for order, _ in places], dtype=np.intp)
        rank = np.argsort(orders, kind="stable")
        return cls(orders[rank], np.array([pole for _, pole in places], dtype=complex)[rank], rank)

    @classmethod
    def of_stabilization(cls, found: Stabilization) -> Tracks:
        """The poles behind the means of a stabilization, at no more than `MAX_ORDERS` orders for each mode."""
        keep: list[int] = []
        for k in range(len(found.modes)):
            own = np.flatnonzero(found.cluster == k)
            keep.extend(own[np.unique(np.linspace(0, own.size - 1, MAX_ORDERS).round().astype(int))].tolist())
        rows = np.sort(np.array(keep, dtype=np.intp))
        omega, zeta = 2 * np.pi * found.frequency_hz[rows], found.damping_ratio[rows]
        return cls(found.orders[rows], omega * (-zeta + 1j * np.sqrt(1 - zeta**2)), found.cluster[rows])

    def modes(self, realization: Realization) -> Modes | None:
        """The means of the poles that stand nearest, each for one mode at most; None where one is lost."""
        from scipy.optimize import linear_sum_assignment  # slow to load

        picked = []
        for order in np.unique(self.orders):
            own, mine = realization.at(int(order)).modes(), self.poles[self.orders == order]
            if len(own) < mine.size:
                return None
            gap = np.abs(own.poles - mine[:, None])
            nearest = linear_sum_assignment(gap)[1]
            if np.any(gap[np.arange(mine.size), nearest] > LOST * np.abs(mine)):
                return None
            picked.append(own.take(nearest))
        shapes = np.concatenate([each.shapes for each in picked], axis=1)
        frequency, damping = (
            np.concatenate([getattr(each, name) for each in picked])
            for name in ("frequency_hz", "damping_ratio")
        )
        mean = cluster_means(Poles.normalized(self.orders, frequency, damping, shapes), self.mode)
        return Modes(mean.frequency_hz, mean.damping_ratio, mean.shapes, realization.systems[0].outputs)


def spectral_scatter(
    recording: Recording,
    realization: Realization,
    tracks: Tracks,
    *,
    settings: Mapping[str, Any] | None = None,
    work: Work = UNHEARD,
) -> ModeErrorBars:
    """Standard deviations of frequencies and damping ratios, and the shift of the latter.

    Args:
        recording: the one that was realized.
        realization: by a method of `SPECTRAL`.
        tracks: where the modes stand among its models.
        settings: further settings that the method was given.
        work: told of every test drawn, or part left out.

    Returns:
        All three.

    Raises:
        TooShortError: too few data to tell.
        IdentificationError: records whose parts do not tell the same, without measured forces.

    Source: as for `residual_scatter` and `jackknife_std`.
    """
    if realization.method == "efdd":
        std = _leaving_pieces_out(recording, realization, tracks)
        return ModeErrorBars(std[0], std[1], np.full(std.shape[1], np.nan))
    again = repeat(recording, realization, np.unique(tracks.orders).tolist(), settings or {})
    n = len(np.unique(tracks.mode))

    def estimate(part: Recording) -> Array:
        try:
            modes = tracks.modes(again(part))
        except IdentificationError:  # too few poles of that part decay
            modes = None
        return (
            np.full(2 * n, np.nan) if modes is None else np.hstack([modes.frequency_hz, modes.damping_ratio])
        )

    if realization.system.inputs:
        modes = tracks.modes(again(recording))
        if modes is None:
            raise IdentificationError(
                "the modes do not come back when the analysis is repeated; take another order"
            )
        model = forced_model(recording, modes, likeliest=True)
        truth = values_near(modes.poles, model.system.modes())
        std, shift = residual_scatter(
            recording, model.residuals, estimate, n_unknowns=model.n_unknowns, truth=truth, work=work
        )
    else:
        std = jackknife_std(recording, estimate, work=work)
        shift = np.full(2 * n, np.nan)
    return ModeErrorBars(std[:n], std[n:], shift[n:])


def values_near(poles: Complex, modes: Modes) -> Array:
    """Frequencies [Hz], then damping ratios, of the modes nearest to given poles; NaN where none is near.

    Args:
        poles: continuous in time [rad/s], shape (n_poles,).
        modes: each is taken for one pole at most.

    Returns:
        Shape (2 n_poles,).
    """
    from scipy.optimize import linear_sum_assignment  # slow to load

    values = np.full((2, poles.size), np.nan)
    gap = np.abs(modes.poles - poles[:, None])
    own, nearest = linear_sum_assignment(gap)
    near = gap[own, nearest] < LOST * np.abs(poles[own])
    own, nearest = own[near], nearest[near]
    values[:, own] = modes.frequency_hz[nearest], modes.damping_ratio[nearest]
    return values.ravel()


def repeat(
    recording: Recording,
    realization: Realization,
    orders: Sequence[int],
    given: Mapping[str, Any],
    *,
    strongest: bool | None = None,
) -> Callable[[Recording], Realization]:
    """The same analysis of another recording, with everything that was chosen held fixed.

    Args:
        recording: the one that was realized.
        realization: by any method but `efdd`.
        orders: those wanted, rising.
        given: further settings that the method was given.
        strongest: for `plscf`, whether to keep the strongest poles of the highest degree; as before when None.

    Returns:
        Function of a recording with the same channels and rate.
    """
    method, own = find_method(realization.method), realization.settings
    fixed: dict[str, Any] = {name: value for name, value in own.items() if name in method.settings}
    fixed |= {name: value for name, value in given.items() if name not in ("orders", "band")}
    if realization.method != "plscf":
        return lambda part: method(part, orders[-1], orders=orders, **fixed)
    if not own["decay"]:  # no window, and the way to the responses is chosen as before
        fixed.pop("decay")
    fixed["band"] = (own["low_hz"], own["high_hz"])
    if 0 < int(own.get("n_references", 0)) < len(recording.outputs) and "references" not in given:
        fixed["references"] = spread_references(recording, int(own["n_references"]))
    if strongest is None:
        strongest = own["poles"] == "strongest"
    return lambda part: method(part, orders[-1] if strongest else None, orders=orders, **fixed)


def _leaving_pieces_out(recording: Recording, realization: Realization, tracks: Tracks) -> Array:
    """Jackknife over groups of neighbouring pieces, shape (2, n_modes)."""
    spectra = cross_spectra(recording, n_segment=int(realization.settings["n_segment"]), zero_padding=2)
    starts = spectra.segments.starts
    n_pieces = sum(len(each) for each in starts)
    n_groups = min(GROUPS, n_pieces)
    if n_groups < 4:
        raise TooShortError(
            f"{n_pieces} pieces of {spectra.segments.length} samples do not tell how much they scatter; "
            "record for longer, or lower n_segment"
        )
    first = np.cumsum([0, *(len(each) for each in starts)])
    borders = np.linspace(0, n_pieces, n_groups + 1).astype(int)
    values = []
    for low, high in pairwise(borders.tolist()):
        left = tuple(
            tuple(k for i, k in enumerate(own, start=int(f)) if not low <= i < high)
            for own, f in zip(starts, first, strict=False)
        )
        segments = replace(spectra.segments, starts=left)
        part = cross_spectra(recording, segments=segments, zero_padding=2)
        found = decomposition(part, min_mac=float(realization.settings["min_mac"])).modes
        values.append(_nearest(found, tracks.poles))
    return spread_of_parts(np.array(values)).reshape(2, -1)


def _nearest(found: Modes, poles: Complex) -> Array:
    """Frequency of the nearest mode to each pole, then the damping ratios; NaN for a lost one."""
    values = np.full((2, poles.size), np.nan)
    if not len(found):
        return values.ravel()
    for k, pole in enumerate(poles):
        i = int(np.argmin(np.abs(found.poles - pole)))
        if abs(found.poles[i] - pole) < LOST * abs(pole):
            values[:, k] = found.frequency_hz[i], found.damping_ratio[i]
    return values.ravel()
