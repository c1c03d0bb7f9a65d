"""From frequency responses alone to modes, and to mass, damping and stiffness where the channels allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from identification.errors import IdentificationError, NotSecondOrderError
from identification.explanation import explanation
from identification.frequency_domain import resonance_band
from identification.identify import Identification
from identification.layout import layout
from identification.line_scatter import line_scatter
from identification.modes import Modes
from identification.plscf import plscf, response_rank
from identification.response import FrequencyResponse
from identification.second_order import second_order
from identification.spectral_scatter import Tracks
from identification.stability import stabilize
from identification.systems import Realization, SecondOrder

METHOD = "plscf"
"""The one method that works on frequency responses."""


def identify_responses(
    response: FrequencyResponse,
    method: str | None = None,
    *,
    order: int | None = None,
    dofs: Sequence[str] | None = None,
    uncertainty: bool = True,
    band: tuple[float, float] | None = None,
    degree: int | None = None,
) -> Identification:
    """Modes of the structure behind frequency responses, and M, C and K where their channels allow.

    Args:
        response: to forces, held over each sample or varying continuously (`dt` is zero, as an analyser measures it).
        method: `plscf`, which is also taken when None.
        order: number of states; None sweeps the degree of the polynomial and keeps the modes that stay put, or takes
            the rank of calculated responses.
        dofs: names of the degrees of freedom of M, C and K in the order wanted.
        uncertainty: whether to find the standard deviations of the modes too.
        band: lowest and highest frequency fitted [Hz]; all lines when None, or those up to well above the resonances where
            the responses are those of samples.
        degree: highest degree of the polynomial, as for `plscf`.

    Returns:
        Modes with standard deviations, matrices without, the models behind them, and the reasons for every choice.

    Raises:
        IdentificationError: another method, or responses that cannot be fitted.

    Source: as for `plscf`; for M, C_d and K De Angelis et al. (2002), J. Appl. Mech. 69, eq. (18).
    """
    if method not in (None, METHOD):
        raise IdentificationError(
            f"method {method!r} needs samples, and there are frequency responses alone; expected {METHOD}; "
            "import the time signals for others"
        )
    if not response.inputs:
        raise IdentificationError("the responses have no input; expected at least one")
    notes: tuple[str, ...] = ("The method is plscf, the one that takes frequency responses.", *response.notes)
    if band is None and response.dt and response_rank(response) is None:
        band = resonance_band(response)
    if band is not None:
        notes = (*notes, f"Lines from {band[0]:.4g} to {band[1]:.4g} Hz are fitted.")
    realization = plscf(response, order, degree=degree, band=band)
    notes = (*notes, *realization.notes)
    stabilization = stabilize(realization) if len(realization.systems) > 1 else None
    if stabilization is None:
        modes = realization.system.modes().normalized()
        stable, tracks = (
            tuple(bool(z >= 0) for z in modes.damping_ratio),
            Tracks.of_modes(modes, realization.order),
        )
    else:
        modes, tracks = stabilization.modes, Tracks.of_stabilization(stabilization)
        stable = (True,) * len(modes)
    matrices, after = _matrices(response, realization, len(modes), dofs, band)
    if uncertainty and len(modes):
        modes, said = _with_bars(response, realization, modes, tracks, band)
        after = (*after, *said)
    warnings = (
        ()
        if len(modes)
        else (
            "No pole stays put over the orders, so no mode is found; name a narrower band, or measure more lines.",
        )
    )
    return Identification(
        realization,
        stabilization,
        modes,
        stable,
        matrices,
        (*notes, *after),
        warnings,
        explanation(notes, stabilization, stable, after),
    )


def _matrices(
    response: FrequencyResponse,
    realization: Realization,
    n_modes: int,
    dofs: Sequence[str] | None,
    band: tuple[float, float] | None,
) -> tuple[SecondOrder | None, tuple[str, ...]]:
    """M, C_d and K of the model with the strongest poles, two states per degree of freedom, or why there are none."""
    try:
        n_dofs = len(layout(response.outputs, response.inputs, dofs=dofs).dofs)
        if n_modes != n_dofs:
            raise NotSecondOrderError(
                f"{n_modes} modes were found and the channels name {n_dofs} degrees of freedom; expected as many; measure "
                "more of them, or name a band with fewer modes"
            )
        n_states = 2 * n_dofs
        system = (
            realization.at(n_states)
            if realization.settings["poles"] == "strongest" and n_states in realization.orders
            else plscf(response, n_states, degree=int(realization.settings["degree"]), band=band).system
        )
        return second_order(system, dofs=dofs), (
            "Mass, damping and stiffness are those of the strongest poles; they have no error bars.",
        )
    except IdentificationError as error:
        return None, (f"Mass, damping and stiffness are left out: {error}.",)


def _with_bars(
    response: FrequencyResponse,
    realization: Realization,
    modes: Modes,
    tracks: Tracks,
    band: tuple[float, float] | None,
) -> tuple[Modes, tuple[str, ...]]:
    """Modes with their standard deviations, or the reason why they have none."""
    try:
        bars = line_scatter(response, realization, tracks, band=band)
    except IdentificationError as error:
        return modes, (f"The modes have no error bars: {error}.",)
    return replace(modes, frequency_std=bars.frequency, damping_std=bars.damping), ()
