"""Mass, damping and stiffness from a state-space model with sensors here and actuators there.

In the right scaling ψ of its complex mode shapes a structure looks the same from a sensor as from an
actuator: a displacement sensor reads the row of ψ that an actuator on the same degree of freedom
drives. One degree of freedom with both fixes the scaling of every mode; after that each other one needs
only one of the two.

The equations are those of De Angelis, Luş, Betti and Longman (2002), J. Appl. Mech. 69, 617-625, with
the off-diagonal blocks of (17b) and the condition of (18b) read as ψψᵀ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.errors import NotSecondOrderError
from identification.layout import Layout, layout
from identification.recording import DERIVATIVE, Array, Channel
from identification.systems import SecondOrder, StateSpace

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class ScaledEigenvectors:
    """Complex mode shapes ψ with (λ² M + λ C_d + K) ψ = 0, scaled so that ψ Λ ψᵀ = M⁻¹.

    Attributes:
        psi: ψ, one column per pole, shape (n_dofs, n_poles).
        poles: λ [rad/s], by rising |λ|, conjugates side by side, shape (n_poles,).
        scaling: diagonal of 𝒯, which takes the shapes of eigenvectors of A of unit length to ψ, shape
            (n_poles,).
        dofs: names of the degrees of freedom.
    """

    psi: Complex
    poles: Complex
    scaling: Complex
    dofs: tuple[str, ...]

    @property
    def closure(self) -> float:
        """Size of ψψᵀ relative to ψψᴴ: 0 for the modes of a structure, large when modes are wrong."""
        return float(np.linalg.norm(self.psi @ self.psi.T) / np.linalg.norm(self.psi @ self.psi.conj().T))


def second_order(system: StateSpace, *, dofs: Sequence[str] | None = None) -> SecondOrder:
    """Mass, damping and stiffness matrices of the structure behind a state-space model.

    Args:
        system: sampled or continuous model with two states per degree of freedom. Its channels say
            which degree of freedom they read or drive (`dof`), how strongly (`factor`) and, by their
            unit, whether they read displacement, velocity or acceleration; channels without `dof` are
            left aside.
        dofs: names in the order wanted; first appearance among the outputs, then the inputs, when None.

    Returns:
        M, C_d and K, real and symmetric; positive definite for exact data, which noise may spoil.

    Raises:
        NotSecondOrderError: the layout or the poles do not determine the matrices; says what to add.

    Source: De Angelis et al. (2002), eq. (18), with the condition ψψᵀ = 0.
    """
    modes = scaled_eigenvectors(system, dofs=dofs)

    def moment(power: int) -> Array:
        return np.asarray(np.real((modes.psi * modes.poles**power) @ modes.psi.T))

    mass = _inverse(moment(1), "mass", modes.dofs)
    stiffness = _inverse(-moment(-1), "stiffness", modes.dofs)
    damping = -mass @ moment(2) @ mass
    return SecondOrder(_symmetric(mass), _symmetric(damping), _symmetric(stiffness), modes.dofs)


def scaled_eigenvectors(system: StateSpace, *, dofs: Sequence[str] | None = None) -> ScaledEigenvectors:
    """Mode shapes at every instrumented degree of freedom, in the scaling of the symmetric form.

    Several channels on one degree of freedom are combined by least squares over their readings, several
    co-located pairs by total least squares over 𝒯² C φ = (φ⁻¹ B)ᵀ, and a shape known from both sides by
    the mean.

    Args:
        system: as for `second_order`.
        dofs: as for `second_order`.

    Returns:
        ψ, the poles and the scaling 𝒯.

    Raises:
        NotSecondOrderError: as for `second_order`.

    Source: De Angelis et al. (2002), eq. (9) to (16), (20) and (21).
    """
    where = layout(system.outputs, system.inputs, dofs=dofs)
    poles, c, b = _modal_form(system, where)
    # 𝒯 of each mode from the co-located pairs: |𝒯|² = |b| / |c|, and the phase that turns c onto b.
    pairs = where.sensed & where.driven
    size_c, size_b = np.linalg.norm(c[pairs], axis=0), np.linalg.norm(b[pairs], axis=0)
    _require_participation(size_c * size_b * np.abs(poles), poles, where)
    angle = np.angle(np.sum(c[pairs].conj() * b[pairs], axis=0))
    t = np.sqrt(size_b / size_c) * np.exp(0.5j * angle)
    psi = (c * t + b / t) / (where.sensed.astype(float) + where.driven)[:, None]
    # Each complex pole stands for its conjugate too.
    order = np.concatenate([[k, ~k] if pole.imag else [k] for k, pole in enumerate(poles)])
    both = [np.where(order >= 0, x[..., order], x[..., ~order].conj()) for x in (psi, poles, t)]
    modes = ScaledEigenvectors(both[0], both[1], both[2], where.dofs)
    _require_true_real_poles(modes)
    return modes


def _modal_form(system: StateSpace, where: Layout) -> tuple[Complex, Complex, Complex]:
    """Poles λ (one of each pair), shapes C φ as displacements and forces (φ⁻¹ B)ᵀ at each degree of freedom.

    Rows of degrees of freedom without a sensor, or without an actuator, are zero.
    """
    z, phi = scipy.linalg.eig(system.A)
    poles = _continuous(z, system.dt)
    _require_complete(system, poles, where)
    own = np.flatnonzero(poles.imag >= 0)
    own = own[np.argsort(np.abs(poles[own]), kind="stable")]
    shapes = (system.C @ phi)[:, own]
    # Zero-order hold, mode by mode: b = b_sampled λ / (z - 1).
    hold = poles / (z - 1) if system.dt else np.ones_like(poles)
    forces = (np.linalg.solve(phi, system.B.astype(complex)) * hold[:, None])[own].T
    poles = poles[own]
    c = np.stack([_least_squares(rows, system.outputs, shapes, poles) for rows in where.sensors])
    b = np.stack([_least_squares(rows, system.inputs, forces, poles) for rows in where.actuators])
    return poles, c, b


def _continuous(z: Complex, dt: float) -> Complex:
    """Continuous-time poles of a model sampled at dt, or the poles themselves when dt is 0."""
    if not dt:
        return np.asarray(z, dtype=complex)
    if np.any((z.imag == 0) & (z.real <= 0)):
        raise NotSecondOrderError(
            "a sampled pole lies on the negative real axis, where no structure has one, so the data do not "
            "show "
            f"{z.size / 2:g} modes; lower the order, excite the missing modes or sample faster"
        )
    return np.asarray(np.log(z.astype(complex)) / dt)


def _least_squares(
    rows: tuple[int, ...], channels: Sequence[Channel], readings: Complex, poles: Complex
) -> Complex:
    """Displacement (or force) of each mode that best explains the channels on one degree of freedom."""
    if not rows:
        return np.zeros(poles.size, dtype=complex)
    gain = np.stack([channels[i].factor * poles ** DERIVATIVE.get(channels[i].quantity, 0) for i in rows])
    return np.asarray(np.sum(gain.conj() * readings[list(rows)], axis=0) / np.sum(np.abs(gain) ** 2, axis=0))


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2


def _inverse(matrix: Array, name: str, dofs: tuple[str, ...]) -> Array:
    if np.linalg.cond(matrix) * np.finfo(float).eps > 1:
        raise NotSecondOrderError(
            f"the {name} matrix cannot be inverted from its modes: two of {', '.join(dofs)} move together "
            f"in all of "
            "them; check the channels' dof, or identify with more excitation"
        )
    return np.asarray(np.linalg.inv(matrix), dtype=float)


def _require_complete(system: StateSpace, poles: Complex, where: Layout) -> None:
    """Two poles per degree of freedom, apart from each other, stable and none at zero."""
    n_modes, n_dofs = system.n_states / 2, len(where.dofs)
    if n_modes < n_dofs:
        raise NotSecondOrderError(
            f"too few modes: {n_modes:g} for the {n_dofs} degrees of freedom {', '.join(where.dofs)}; "
            f"take order {2 * n_dofs}, and if the data do not support it excite the missing modes"
        )
    if n_modes > n_dofs:
        raise NotSecondOrderError(
            f"too many modes: {n_modes:g} for the {n_dofs} degrees of freedom {', '.join(where.dofs)}; "
            f"take order {2 * n_dofs}, or instrument the degrees of freedom that are not listed"
        )
    size = np.abs(poles)
    if np.min(size) < 1e-8 * np.max(size):
        raise NotSecondOrderError(
            "a pole is zero: the structure moves freely and its flexibility is infinite; "
            "fix it to the ground or leave the free motion out"
        )
    worst = int(np.argmax(poles.real / size))
    if poles.real[worst] > 1e-8 * size[worst]:
        raise NotSecondOrderError(
            f"the mode at {size[worst] / (2 * np.pi):.4g} Hz is unstable (damping ratio "
            f"{-poles.real[worst] / size[worst]:.2g}), as no structure at rest is; "
            "lower the order or lengthen the record"
        )
    gap = np.abs(poles[:, None] - poles) + np.diag(np.full(poles.size, np.inf))
    i, j = np.unravel_index(int(np.argmin(gap)), gap.shape)
    if gap[i, j] < 1e-8 * size[i]:
        raise NotSecondOrderError(
            f"two modes coincide at {size[i] / (2 * np.pi):.6g} Hz, so their shapes cannot be told apart; "
            "break the symmetry with a small added mass"
        )


def _require_participation(strength: Array, poles: Complex, where: Layout) -> None:
    """Every mode moves a co-located pair: strength is |ψ|² |λ| there, comparable over the modes."""
    still = np.flatnonzero(np.sqrt(strength) < 1e-8 * np.sqrt(np.max(strength)))
    if still.size:
        pairs = [dof for dof, both in zip(where.dofs, where.sensed & where.driven, strict=True) if both]
        listed = ", ".join(f"{abs(poles[k]) / (2 * np.pi):.4g}" for k in still)
        raise NotSecondOrderError(
            f"the mode at {listed} Hz does not move {', '.join(pairs)}, the only place with both a sensor "
            f"and an "
            "actuator; add such a pair elsewhere"
        )


def _require_true_real_poles(modes: ScaledEigenvectors) -> None:
    """Real poles are those of overdamped modes, whose two shapes cancel in ψψᵀ; spurious ones do not."""
    real = modes.poles[modes.poles.imag == 0]
    if real.size and modes.closure > 0.05:
        raise NotSecondOrderError(
            f"the poles {', '.join(f'{pole.real:.4g}' for pole in real)} rad/s are real and belong to no "
            f"mode of "
            f"{len(modes.dofs)} degrees of freedom; lower the order or lengthen the record"
        )
