"""Modes: frequency, damping and shape of what oscillates, and how alike two shapes are."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import IdentificationError
from identification.recording import Array, Channel, frozen

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False, repr=False)
class Modes:
    """Oscillating modes, sorted by frequency.

    Attributes:
        frequency_hz: undamped natural frequency |λ| / 2π, shape (n_modes,).
        damping_ratio: -Re λ / |λ|, shape (n_modes,); negative for an unstable pole.
        shapes: complex mode shape at the output channels, shape (n_outputs, n_modes), in the unit of each channel.
        outputs: output channels.
        frequency_std: one standard deviation [Hz], shape (n_modes,); None where none was estimated.
        damping_std: one standard deviation [1], shape (n_modes,); None where none was estimated.
    """

    frequency_hz: Array
    damping_ratio: Array
    shapes: Complex
    outputs: tuple[Channel, ...]
    frequency_std: Array | None = None
    damping_std: Array | None = None

    def __post_init__(self) -> None:
        for name in ("frequency_hz", "damping_ratio", "frequency_std", "damping_std"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, frozen(value))
        shapes = np.array(self.shapes, dtype=np.complex128)
        shapes.setflags(write=False)
        object.__setattr__(self, "shapes", shapes)
        n = self.frequency_hz.size
        if self.damping_ratio.shape != (n,) or shapes.shape != (len(self.outputs), n):
            raise IdentificationError(
                f"{n} frequencies, {self.damping_ratio.shape} damping ratios and shapes {shapes.shape} do not fit together; "
                f"expected shapes ({len(self.outputs)}, {n})"
            )

    @classmethod
    def from_poles(cls, poles: Complex, shapes: Complex, outputs: tuple[Channel, ...]) -> Modes:
        """Modes of continuous-time poles λ [rad/s], one of each conjugate pair, with shapes (n_outputs, n_modes)."""
        omega = np.abs(poles)
        rank = np.argsort(omega, kind="stable")
        omega = omega[rank]
        return cls(omega / (2 * np.pi), -poles[rank].real / omega, shapes[:, rank], outputs)

    @property
    def poles(self) -> Complex:
        """Continuous-time poles with positive imaginary part [rad/s], shape (n_modes,)."""
        omega = 2 * np.pi * self.frequency_hz
        zeta = self.damping_ratio
        return np.asarray(omega * (-zeta + 1j * np.sqrt(1 - zeta**2)))

    def __len__(self) -> int:
        return int(self.frequency_hz.size)

    def take(self, which: ArrayLike) -> Modes:
        """The modes at the given positions (or where a mask is true); none for an empty list."""
        keep = np.asarray(which)
        if not keep.size:
            keep = keep.astype(np.intp)  # an empty list has no type of its own
        frequency_std, damping_std = (
            None if std is None else std[keep] for std in (self.frequency_std, self.damping_std)
        )
        return Modes(
            self.frequency_hz[keep],
            self.damping_ratio[keep],
            self.shapes[:, keep],
            self.outputs,
            frequency_std,
            damping_std,
        )

    def normalized(self) -> Modes:
        """The same modes with the largest component of each shape equal to one."""
        largest = np.argmax(np.abs(self.shapes), axis=0)
        scale = self.shapes[largest, np.arange(len(self))]
        return self.scaled(1 / np.where(scale == 0, 1, scale))

    def unit_length(self) -> Modes:
        """The same modes with φᴴφ = 1 for each shape; the phase stays."""
        length = np.linalg.norm(self.shapes, axis=0)
        return self.scaled(1 / np.where(length == 0, 1, length))

    def scaled(self, factors: ArrayLike) -> Modes:
        """The same modes with each shape multiplied by a number of its own, shape (n_modes,)."""
        return replace(self, shapes=self.shapes * np.asarray(factors))

    def __repr__(self) -> str:
        listed = ", ".join(
            f"{f:.4g} Hz ({100 * z:.3g} %)"
            for f, z in zip(self.frequency_hz, self.damping_ratio, strict=True)
        )
        return f"Modes({listed or 'none'})"


def oscillating(poles: Complex, dt: float) -> NDArray[np.bool_]:
    """Which poles stand for an oscillation: one of each conjugate pair.

    Args:
        poles: continuous-time [rad/s], of any shape.
        dt: sample time of the model they come from [s]; 0 for one that is continuous in time.

    Returns:
        A mask of the same shape.
    """
    own = poles.imag > 1e-12 * np.abs(poles)
    # A sampled pole on the negative real axis has an imaginary logarithm but no partner: not a mode.
    return np.asarray(own & (poles.imag < (1 - 1e-12) * np.pi / dt) if dt else own)


def mac(a: Complex, b: Complex) -> Array:
    """Modal assurance criterion between the shapes of two sets, shape (n_modes_a, n_modes_b), from 0 to 1.

    Args:
        a: shapes, (n_outputs, n_modes_a).
        b: shapes at the same outputs, (n_outputs, n_modes_b).

    Returns:
        Squared cosines between the shapes.

    Raises:
        IdentificationError: the sets have different outputs.

    Source: Allemang and Brown (1982), Proc. 1st IMAC, eq. (7): |aᴴb|² / (aᴴa · bᴴb).
    """
    a, b = _same_outputs(a, b)
    squared = np.outer(np.sum(np.abs(a) ** 2, axis=0), np.sum(np.abs(b) ** 2, axis=0))
    return np.asarray(np.abs(a.conj().T @ b) ** 2 / np.where(squared == 0, 1, squared))


def auto_mac(shapes: Complex) -> Array:
    """MAC of a set with itself, shape (n_modes, n_modes): off the diagonal, how badly the outputs tell modes apart.

    Args:
        shapes: shape (n_outputs, n_modes).

    Returns:
        Ones on the diagonal.

    Source: Allemang (2003), Sound Vib. 37(8), 14-21: |φ_iᴴ φ_j|² / (φ_iᴴ φ_i · φ_jᴴ φ_j).
    """
    return mac(shapes, shapes)


def comac(a: Complex, b: Complex) -> Array:
    """Coordinate MAC: agreement of two sets of paired shapes at each output, shape (n_outputs,), from 0 to 1.

    Each shape counts with length one, whatever its scaling. An output at which no shape moves agrees: 1.

    Args:
        a: shapes, (n_outputs, n_modes).
        b: shapes of the same modes in the same order, likewise.

    Returns:
        One number per output.

    Raises:
        IdentificationError: the sets differ in outputs or modes.

    Source: Lieven and Ewins (1988), Proc. 6th IMAC, 690-695: (Σ|a b*|)² / (Σ|a|² Σ|b|²), sums over modes.
    """
    a, b = _same_outputs(a, b)
    if a.shape != b.shape:
        raise IdentificationError(
            f"the sets have {a.shape[1]} and {b.shape[1]} modes; expected pairs, with the unpaired ones left out"
        )
    a, b = (x / np.where(np.any(x, axis=0), np.linalg.norm(x, axis=0), 1) for x in (a, b))
    squared = np.sum(np.abs(a) ** 2, axis=1) * np.sum(np.abs(b) ** 2, axis=1)
    still = ~(np.any(a, axis=1) | np.any(b, axis=1))
    share = np.sum(np.abs(a * b.conj()), axis=1) ** 2 / np.where(squared == 0, 1, squared)
    return np.where(still, 1.0, share)


def cross_orthogonality(a: Complex, b: Complex, mass: Array) -> Array:
    """|aᴴ M b| of shapes scaled to aᴴ M a = bᴴ M b = 1, shape (n_modes_a, n_modes_b), from 0 to 1.

    One for the same mode and zero for different ones, which the MAC promises only where the mass is equal
    at all outputs.

    Args:
        a: displacement shapes at the degrees of freedom of M, (n_dofs, n_modes_a).
        b: likewise, (n_dofs, n_modes_b).
        mass: M, symmetric and positive definite, shape (n_dofs, n_dofs).

    Returns:
        One number per pair.

    Raises:
        IdentificationError: the shapes differ in length from M.

    Source: Targoff (1976), AIAA J. 14(2), 164-168; Ewins (2000), Modal Testing, section 5.4.
    """
    a, b = _same_outputs(a, b)
    if mass.shape != (len(a), len(a)):
        raise IdentificationError(
            f"shapes have {len(a)} degrees of freedom and the mass matrix is {mass.shape}; expected the same"
        )
    size = [np.sqrt(np.einsum("om,op,pm->m", x.conj(), mass, x).real) for x in (a, b)]
    product = np.outer(*size)
    return np.asarray(np.abs(a.conj().T @ mass @ b) / np.where(product == 0, 1, product))


def _same_outputs(a: Complex, b: Complex) -> tuple[Complex, Complex]:
    a, b = np.asarray(a), np.asarray(b)
    if a.shape[0] != b.shape[0]:
        raise IdentificationError(
            f"shapes have {a.shape[0]} and {b.shape[0]} outputs; expected the same outputs in both"
        )
    return a, b


def modal_phase_collinearity(shapes: Complex) -> Array:
    """How far each shape is from a monophase one, shape (n_modes,): 1 when all parts move in phase or in opposition.

    Args:
        shapes: shape (n_outputs, n_modes).

    Returns:
        Numbers from 0 to 1.

    Source: Juang and Pappa (1985), J. Guidance 8(5), the coherence of a shape's real and imaginary parts; written with
    the eigenvalues l1 >= l2 of their 2 x 2 covariance as ((l1 - l2) / (l1 + l2))².
    """
    x, y = shapes.real, shapes.imag
    sxx, syy, sxy = np.sum(x * x, axis=0), np.sum(y * y, axis=0), np.sum(x * y, axis=0)
    total = (sxx + syy) ** 2
    return np.asarray(((sxx - syy) ** 2 + 4 * sxy**2) / np.where(total == 0, 1, total))


def mean_phase(shapes: Complex) -> Array:
    """Phase of the line in the complex plane that each shape lies along [rad], shape (n_modes,), in (-π/2, π/2].

    The line through the origin from which the components have the least sum of squared distances.

    Args:
        shapes: shape (n_outputs, n_modes).

    Returns:
        One angle per mode.

    Source: Reynders, Houbrechts and De Roeck (2012), Mech. Syst. Signal Process. 29, eq. (9); there by a singular
    value decomposition, here as half the phase of Σφ².
    """
    return np.asarray(np.angle(np.sum(shapes**2, axis=0)) / 2)


def mean_phase_deviation(shapes: Complex) -> Array:
    """Mean angle between the components and the mean phase [rad], weighted by their size, shape (n_modes,).

    Zero for a monophase shape; π/4 for components all around the circle.

    Args:
        shapes: shape (n_outputs, n_modes).

    Returns:
        One angle per mode.

    Source: Reynders, Houbrechts and De Roeck (2012), Mech. Syst. Signal Process. 29, eq. (10).
    """
    size = np.abs(shapes)
    turned = shapes * np.exp(-1j * mean_phase(shapes))
    angle = np.arctan2(np.abs(turned.imag), np.abs(turned.real))
    total = np.sum(size, axis=0)
    return np.asarray(np.sum(size * angle, axis=0) / np.where(total == 0, 1, total))


def real_shapes(shapes: Complex) -> Array:
    """The real shape nearest to each complex one up to a turn: real part along its mean phase, same array shape.

    Args:
        shapes: shape (n_outputs, n_modes).

    Returns:
        Real numbers of the same shape.

    Source: Ahmadian, Gladwell and Ismail (1995), J. Sound Vib. 182(4): of all turned copies it has the largest
    real part, and that is where the phase of Σφ² = 0.
    """
    return np.asarray((shapes * np.exp(-1j * mean_phase(shapes))).real)
