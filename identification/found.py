"""What a method found before its modes are turned into matrices: the recording, its models, and where the modes stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from identification.errors import IdentificationError
from identification.forced_model import forced_matrices
from identification.layout import layout
from identification.modes import Modes
from identification.recording import Recording
from identification.second_order import second_order
from identification.spectral_scatter import Tracks, repeat
from identification.stability import Stabilization
from identification.systems import Realization, SecondOrder, StateSpace
from identification.uncertainty import Placed


@dataclass(frozen=True, eq=False)
class Found:
    """Modes and the models they come from.

    Attributes:
        recording: what was analysed.
        realization: models of all orders.
        stabilization: poles of all orders; None where there is one.
        modes: those found.
        places: where each mode has settled; None where all are those of the realization's own order.
        settings: further settings that the method was given.
    """

    recording: Recording
    realization: Realization
    stabilization: Stabilization | None
    modes: Modes
    places: list[Placed] | None
    settings: dict[str, Any]

    @property
    def forced(self) -> bool:
        """Whether forces were measured in every record."""
        return bool(self.recording.inputs) and all(r.inputs.shape[0] for r in self.recording.records)

    def tracks(self) -> Tracks:
        """The poles behind the modes."""
        if self.places is None or self.stabilization is None:
            return Tracks.of_modes(self.modes, self.realization.order)
        if self.realization.method == "plscf":
            return Tracks.of_stabilization(self.stabilization)
        return Tracks.of_places(self.places)

    def own_model(self) -> StateSpace | None:
        """The model that the modes are those of; None where they are means over orders."""
        return self.realization.system if self.places is None else None


def matrices_of(
    found: Found, dofs: Sequence[str] | None, *, uncertainty: bool = True
) -> tuple[SecondOrder | None, tuple[str, ...]]:
    """M, C_d and K with where they come from, or why there are none.

    Of a model with two states per degree of freedom where the method realizes the response to known forces; else of
    the likeliest model near one mode per degree of freedom. Where other than that many modes were found, pLSCF is
    asked for that many.

    Args:
        found: modes and models.
        dofs: as for `second_order`.
        uncertainty: as for `forced_matrices`.

    Returns:
        The matrices or None, and sentences on them.

    Source: De Angelis et al. (2002), J. Appl. Mech. 69, eq. (18).
    """
    realization, system = found.realization, found.realization.system
    try:
        if not found.forced or realization.method in ("era", "okid_era"):
            n_states = 2 * len(layout(system.outputs, system.inputs, dofs=dofs).dofs)
            if n_states in realization.orders:
                system = realization.at(n_states)
            return second_order(system, dofs=dofs), ()
        names = layout(found.recording.outputs, found.recording.inputs, dofs=dofs).dofs
        if len(found.modes) != len(names) and realization.settings.get("poles") == "all":
            found = _of_order(found, 2 * len(names))
        matrices, sentence = forced_matrices(
            found.recording, found.modes, dofs=names, uncertainty=uncertainty
        )
    except IdentificationError as error:
        return None, (f"Mass, damping and stiffness are left out: {error}.",)
    return matrices, (sentence,)


def _of_order(found: Found, order: int) -> Found:
    """The modes of the strongest poles of that many states."""
    again = repeat(found.recording, found.realization, [order], found.settings, strongest=True)
    realization = again(found.recording)
    return Found(found.recording, realization, None, realization.system.modes(), None, found.settings)
