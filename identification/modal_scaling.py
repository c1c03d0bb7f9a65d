"""How much force it takes to move a mode: modal mass, where a force was measured next to a sensor.

With shapes φ of displacement, H(s) = Σ_r φ_r φ_rᵀ / (a_r (s - λ_r)) + conjugate. Outputs alone leave the
size of a_r open; a driving point, where a sensor reads the degree of freedom that an actuator drives, gives it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.errors import NotSecondOrderError
from identification.modes import Modes
from identification.recording import DERIVATIVE, Channel
from identification.systems import StateSpace

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class ModalScaling:
    """Modes with the scale that forces give them.

    Attributes:
        modes: displacement shapes at the degrees of freedom that have sensors, largest component one.
        modal_a: a_r of these shapes, shape (n_modes,) [kg/s].
    """

    modes: Modes
    modal_a: Complex

    @property
    def modal_mass(self) -> Complex:
        """m_r = a_r / (2i ω_d), shape (n_modes,) [kg].

        Real, and equal to φᵀ M φ, for shapes without phase; an imaginary part tells how far they are from that.
        """
        return np.asarray(self.modal_a / (2j * self.modes.poles.imag))

    def unit_modal_a(self) -> Modes:
        """Shapes ψ with a_r = 1, so that H = Σ ψψᵀ / (s - λ) + conjugate, up to their sign.

        The scaling of `scaled_eigenvectors`: ψ Λ ψᵀ = M⁻¹ with all modes, De Angelis et al. (2002), eq. (14).
        """
        return self.modes.scaled(1 / np.sqrt(self.modal_a))

    def unit_modal_mass(self) -> Modes:
        """Shapes with m_r = 1, up to their sign: φᵀ M φ = 1 where they have no phase."""
        return self.modes.scaled(1 / np.sqrt(self.modal_mass))


def modal_scaling(system: StateSpace) -> ModalScaling:
    """Modal mass of every mode of a model, from its driving points.

    Sensors of displacement, velocity and acceleration, and several driving points, are combined by least
    squares. Modes need not be complete, nor every degree of freedom instrumented.

    Args:
        system: sampled or continuous; its channels say which degree of freedom they read or drive.

    Returns:
        Modal a and modal mass of each mode.

    Raises:
        NotSecondOrderError: no degree of freedom has both a sensor and an actuator, or a mode does not move
            any that has.

    Source: Ewins (2000), Modal Testing, section 2.5 and 4.3; Heylen, Lammens and Sas (1997), Modal Analysis Theory
        and Testing, section A.1.4, for modal a.
    """
    sensed = _by_dof(system.outputs, motion_only=True)
    driven = _by_dof(system.inputs, motion_only=False)
    pairs = [k for k, dof in enumerate(sensed) if dof in driven]
    if not pairs:
        raise NotSecondOrderError(
            f"modal mass needs a sensor next to an actuator; sensors are on {', '.join(sensed) or 'none'} and "
            f"actuators on {', '.join(driven) or 'none'}"
        )
    poles, shapes, forces = _modal_form(system)
    c = np.stack([_combined(rows, system.outputs, shapes, poles) for rows in sensed.values()])
    names = tuple(sensed)
    b = np.stack([_combined(driven[names[k]], system.inputs, forces, poles) for k in pairs])
    size_c, size_b = np.linalg.norm(c[pairs], axis=0), np.linalg.norm(b, axis=0)
    still = np.minimum(size_c / np.linalg.norm(c, axis=0), size_b / np.max(size_b, initial=1e-300)) < 1e-10
    if np.any(still):
        raise NotSecondOrderError(
            f"the mode at {abs(poles[np.argmax(still)]) / (2 * np.pi):.4g} Hz does not move "
            f"{', '.join(names[k] for k in pairs)}, where both a sensor and an actuator are; add such a pair elsewhere"
        )
    # b = c / a with errors on both sides.
    a = size_c / size_b * np.exp(1j * np.angle(np.sum(c[pairs] * b.conj(), axis=0)))
    channels = tuple(Channel(name, "m", name) for name in names)
    modes = Modes.from_poles(poles, c, channels)
    largest = c[np.argmax(np.abs(c), axis=0), np.arange(poles.size)]
    rank = np.argsort(np.abs(poles), kind="stable")
    return ModalScaling(modes.normalized(), (a / largest**2)[rank])


def _modal_form(system: StateSpace) -> tuple[Complex, Complex, Complex]:
    """Continuous poles with positive imaginary part, C φ, and (φ⁻¹ B)ᵀ as for an input that is not held."""
    z, phi = scipy.linalg.eig(system.A)
    own = z.imag > 0
    forces = np.linalg.solve(phi, system.B.astype(complex))[own]
    poles = z[own]
    if system.dt:
        poles = np.log(z[own]) / system.dt
        forces *= (poles / (z[own] - 1))[:, None]  # zero-order hold, mode by mode
    return poles, (system.C @ phi)[:, own], forces.T


def _by_dof(channels: Sequence[Channel], *, motion_only: bool) -> dict[str, list[int]]:
    """Positions of the channels on each degree of freedom."""
    found: dict[str, list[int]] = {}
    for k, channel in enumerate(channels):
        if channel.dof and (channel.quantity in DERIVATIVE or not motion_only):
            found.setdefault(channel.dof, []).append(k)
    return found


def _combined(rows: list[int], channels: Sequence[Channel], readings: Complex, poles: Complex) -> Complex:
    """Displacement, or generalized force, that explains the channels on one degree of freedom best."""
    gain = np.stack([channels[k].factor * poles ** DERIVATIVE.get(channels[k].quantity, 0) for k in rows])
    return np.asarray(np.sum(gain.conj() * readings[rows], axis=0) / np.sum(np.abs(gain) ** 2, axis=0))
