"""Frequency domain decomposition: the spectral matrix of the outputs, taken apart line by line.

At a resonance one mode dominates: the first singular vector of G(f) is its shape, and the first singular
value is its power, as that of a single oscillator, as far from the peak as the shape holds. The correlation
of that bell gives frequency and damping.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy.special
from numpy.typing import NDArray

from identification.bells import Bell, bell_pole, find_bells
from identification.errors import IdentificationError, OrderError
from identification.modal_form import modal_outputs, modal_states
from identification.modes import Modes
from identification.recording import Array, Recording, frozen
from identification.spectra import CrossSpectra, cross_spectra, unit_sizes
from identification.systems import Realization, StateSpace

Complex = NDArray[np.complex128]

CHANCE = 0.01
"""Probability that a spectrum without any resonance shows a peak."""


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyDomainDecomposition:
    """Singular values of the spectral matrix, the bells found among them, and the modes they give.

    Attributes:
        frequency_hz: lines, shape (n_lines,).
        singular_values: of G(f), largest first, shape (n_lines, n_outputs) [unit² / Hz]; outputs of different
            units are brought to one scale.
        bells: one per mode.
        peak_hz: frequency of each peak, the estimate of plain FDD, shape (n_modes,).
        modes: frequency and damping from the correlation of each bell (EFDD), sorted by frequency, as are
            the bells.
        n_averages: independent pieces behind each line.
        n_segment: samples of a piece.
        notes: what was chosen and why, one sentence each.
    """

    frequency_hz: Array
    singular_values: Array
    bells: tuple[Bell, ...]
    peak_hz: Array
    modes: Modes
    n_averages: float
    n_segment: int
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("frequency_hz", "singular_values", "peak_hz"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __repr__(self) -> str:
        return (
            f"FrequencyDomainDecomposition({len(self.modes)} modes, {self.frequency_hz.size} lines, "
            f"{self.n_averages:.3g} averages)"
        )


def fdd(
    recording: Recording, *, n_segment: int | None = None, min_mac: float = 0.8
) -> FrequencyDomainDecomposition:
    """Modes of a structure from the singular values of the spectral matrix of its outputs.

    A peak counts when it rises from the valleys on both sides by more than averaged spectra scatter: by the
    ratio that the largest of all pairs of lines of a flat spectrum exceeds once in a hundred times. It must
    keep its shape until it has fallen to half. Modes that lie closer than the lines of a piece, or that
    weakly driven stay below the flank of another with the same shape, are not told apart.

    Args:
        recording: outputs of a structure under broadband random excitation; inputs are not used.
        n_segment: samples of a piece; chosen for about 32 averages when None. Longer pieces part closer
            modes, shorter ones scatter less.
        min_mac: least resemblance to the shape of the peak of a line that belongs to its bell.

    Returns:
        Singular values, bells, and modes with frequency and damping from the bells.

    Raises:
        RecordingError: a sample is missing.
        TooShortError: no record is as long as `n_segment`.

    Source: Brincker, Zhang and Andersen (2001), Smart Mater. Struct. 10, 441-445 (FDD): G(f) = U S Uᴴ at each
        line; Brincker, Ventura and Andersen (2001), Proc. 19th IMAC (enhanced FDD): log of the correlation of a bell
        = λ t + constant.
    """
    return decomposition(cross_spectra(recording, n_segment=n_segment, zero_padding=2), min_mac=min_mac)


def decomposition(spectra: CrossSpectra, *, min_mac: float = 0.8) -> FrequencyDomainDecomposition:
    """Modes from spectra that are there already.

    Args:
        spectra: of twice as many lines as the pieces have, `zero_padding` 2.
        min_mac: as for `fdd`.

    Returns:
        As for `fdd`.

    Source: as for `fdd`.
    """
    size = unit_sizes(np.einsum("foo->o", spectra.values).real, spectra.outputs)
    power, vectors = np.linalg.eigh(spectra.values / size[:, None] / size)
    S, U = np.maximum(power[:, ::-1], 0), vectors[:, :, ::-1]
    segments, n = spectra.segments, spectra.segments.n_averages
    # Half as many lines as the padded transform has are independent, and any two of them may be compared.
    share = scipy.special.betainccinv(n, n, CHANCE / (len(S) / 2) ** 2)
    factor = float(share / (1 - share))  # of two spectra with 2n degrees of freedom each: the F distribution
    bells = find_bells(S, U, factor=factor, min_mac=min_mac)
    window = spectra.lag_window()
    poles = np.array([bell_pole(bell, 2 * segments.length, spectra.dt, window) for bell in bells], complex)
    shapes = size[:, None] * np.array([bell.shape for bell in bells], complex).reshape(-1, size.size).T
    peaks = spectra.frequency_hz[[bell.peak for bell in bells]]
    rank = np.argsort(np.abs(poles), kind="stable")
    note = f"A peak must rise by a factor of {factor:.3g}, as {n:.3g} averages scatter less than that."
    return FrequencyDomainDecomposition(
        spectra.frequency_hz,
        S,
        tuple(bells[k] for k in rank),
        peaks[rank],
        Modes.from_poles(poles, shapes, spectra.outputs),
        n,
        segments.length,
        (*segments.notes, note),
    )


def efdd(
    recording: Recording,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    n_segment: int | None = None,
    min_mac: float = 0.8,
) -> Realization:
    """Modes of enhanced frequency domain decomposition, as a state-space model with two states for each.

    The method finds modes, not models of rising order: a model of order 2 n holds the n modes whose peaks stand
    out most. That a mode recurs at a higher order says nothing, so there is one order unless more are asked
    for. In place of singular values stand those of the spectral matrix at the peaks, largest first.

    Args:
        recording: as for `fdd`.
        order: twice the number of modes to keep; all when None.
        orders: further orders.
        n_segment: as for `fdd`.
        min_mac: as for `fdd`.

    Returns:
        Models without inputs, whose outputs are those of the recording.

    Raises:
        OrderError: an odd order, or more modes than peaks.
        IdentificationError: no peak stands out.

    Source: as for `fdd`.
    """
    found = fdd(recording, n_segment=n_segment, min_mac=min_mac)
    if not found.bells:
        raise IdentificationError(
            f"no peak stands out of spectra of {found.n_averages:.3g} averages; "
            "record for longer, or lower n_segment for more averages"
        )
    wanted = sorted({*(orders or ()), *(() if order is None else (order,))}) or [2 * len(found.bells)]
    wrong = [n for n in wanted if n < 2 or n % 2 or n > 2 * len(found.bells)]
    if wrong:
        raise OrderError(
            f"order {wrong[0]} cannot be made of {len(found.bells)} peaks, each of which gives two states; "
            f"ask for an even order up to {2 * len(found.bells)}"
        )
    by_prominence = np.argsort([-bell.prominence for bell in found.bells], kind="stable")
    systems = tuple(_model(found.modes.take(np.sort(by_prominence[: n // 2])), recording.dt) for n in wanted)
    peaks = np.sort([float(np.max(bell.power)) for bell in found.bells])[::-1]
    settings: dict[str, int | float | str] = {
        "min_mac": min_mac,
        "n_averages": found.n_averages,
        "n_segment": found.n_segment,
    }
    return Realization("efdd", systems, peaks, order or wanted[-1], settings, found.notes)


def _model(modes: Modes, dt: float) -> StateSpace:
    z = np.exp(modes.poles * dt)
    A, B = modal_states(z, np.zeros((z.size, 0), complex))
    C = modal_outputs(z, modes.shapes)
    return StateSpace(A, B, C, np.zeros((len(C), 0)), dt, (), modes.outputs)
