"""Modes: frequency, damping and shape of what oscillates, and how alike two shapes are."""

from __future__ import annotations

from dataclasses import dataclass

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
        """The modes at the given positions (or where a mask is true)."""
        keep = np.asarray(which)
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
        shapes = self.shapes / np.where(scale == 0, 1, scale)
        return Modes(
            self.frequency_hz, self.damping_ratio, shapes, self.outputs, self.frequency_std, self.damping_std
        )

    def __repr__(self) -> str:
        listed = ", ".join(
            f"{f:.4g} Hz ({100 * z:.3g} %)"
            for f, z in zip(self.frequency_hz, self.damping_ratio, strict=True)
        )
        return f"Modes({listed or 'none'})"


def mac(a: Complex, b: Complex) -> Array:
    """Modal assurance criterion between the shapes of two sets, shape (n_modes_a, n_modes_b), from 0 to 1.

    Args:
        a: shapes, (n_outputs, n_modes_a).
        b: shapes at the same outputs, (n_outputs, n_modes_b).

    Raises:
        IdentificationError: the sets have different outputs.

    Source: Allemang and Brown (1982), Proc. 1st IMAC, eq. (7): |aᴴb|² / (aᴴa · bᴴb).
    """
    a, b = np.asarray(a), np.asarray(b)
    if a.shape[0] != b.shape[0]:
        raise IdentificationError(
            f"shapes have {a.shape[0]} and {b.shape[0]} outputs; expected the same outputs in both"
        )
    squared = np.outer(np.sum(np.abs(a) ** 2, axis=0), np.sum(np.abs(b) ** 2, axis=0))
    return np.abs(a.conj().T @ b) ** 2 / np.where(squared == 0, 1, squared)


def modal_phase_collinearity(shapes: Complex) -> Array:
    """How far each shape is from a monophase one, shape (n_modes,): 1 when all parts move in phase or in opposition.

    Source: Juang and Pappa (1985), J. Guidance 8(5), the coherence of a shape's real and imaginary parts; written with
    the eigenvalues l1 >= l2 of their 2 x 2 covariance as ((l1 - l2) / (l1 + l2))².
    """
    x, y = shapes.real, shapes.imag
    sxx, syy, sxy = np.sum(x * x, axis=0), np.sum(y * y, axis=0), np.sum(x * y, axis=0)
    total = (sxx + syy) ** 2
    return np.asarray(((sxx - syy) ** 2 + 4 * sxy**2) / np.where(total == 0, 1, total))
