"""Parameters: what a model has already, each with a prior that says how well it is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from identification.recording import Array

LOOSE = 1e-6
"""Precision left in a direction whose prior is lifted."""


@dataclass(frozen=True, eq=False)
class Parameters:
    """What the model has already: a factor on every mass, stiffness and damping, each with a prior; and unknown starts.

    Attributes:
        names: of the parameters.
        widths: one standard deviation of the logarithm of each factor, then the scale of each unknown of a start.
        n_bodies, n_springs: masses come first, then stiffnesses, then dampings, then gains of inputs, then displacements and
            velocities at the start of records that do not begin at rest.
        precision: of the prior, in widths: the identity, but for starts and directions that were found to be wrong.
        started: numbers of the records that do not begin at rest.
        inputs: numbers of the inputs whose gain is not known exactly.
    """

    names: tuple[str, ...]
    widths: Array
    n_bodies: int
    n_springs: int
    precision: Array
    started: tuple[int, ...] = ()
    inputs: tuple[int, ...] = ()

    @property
    def n(self) -> int:
        """Number of parameters."""
        return self.widths.size

    @property
    def n_factors(self) -> int:
        """Number of masses, stiffnesses, dampings and gains."""
        return self.n_structural + len(self.inputs)

    @property
    def n_structural(self) -> int:
        """Number of masses, stiffnesses and dampings."""
        return self.n_bodies + 2 * self.n_springs

    def allowed(self, step: Array) -> float:
        """Share of a step (n,) that changes no factor by more than e: a line through its logarithm tells nothing of farther."""
        longest = np.max(np.abs(step[: self.n_factors] * self.widths[: self.n_factors]), initial=0.0)
        return float(1 / max(longest, 1.0))

    def factors(self, theta: Array) -> tuple[Array, Array, Array]:
        """Factors on masses, stiffnesses and dampings at `theta`, in units of the prior's width."""
        n = self.n_structural
        factors = np.exp(np.clip(theta[:n] * self.widths[:n], -3, 3))
        a, b = self.n_bodies, self.n_bodies + self.n_springs
        return factors[:a], factors[a:b], factors[b:]

    def gains(self, theta: Array) -> Array:
        """Factors on the inputs whose gain is not known exactly, (n_gains,)."""
        own = slice(self.n_structural, self.n_factors)
        return np.asarray(np.exp(np.clip(theta[own] * self.widths[own], -3, 3)))

    def start(self, theta: Array, record: int) -> Array | None:
        """Displacements and velocities at the start of a record; None where it begins at rest."""
        if record not in self.started:
            return None
        of_each = (self.n - self.n_factors) // len(self.started)
        first = self.n_factors + self.started.index(record) * of_each
        return theta[first : first + of_each] * self.widths[first : first + of_each]

    def with_start(self, record: int, scale: Array) -> Parameters:
        """The parameters with an unknown start of one more record, its unknowns of about that scale."""
        names = tuple(f"start {record} {i}" for i in range(scale.size))
        precision = np.diag(np.full(self.n + scale.size, LOOSE))
        precision[: self.n, : self.n] = self.precision
        return replace(
            self,
            names=(*self.names, *names),
            widths=np.concatenate([self.widths, scale]),
            precision=precision,
            started=(*self.started, record),
        )

    def group(self, name: str) -> list[int]:
        """Numbers of all masses, stiffnesses or dampings."""
        return [i for i, each in enumerate(self.names) if each.partition(" ")[0] == name]

    @property
    def free(self) -> Array:
        """Orthonormal directions without a prior, as columns (n, n_free)."""
        values, vectors = np.linalg.eigh(self.precision)
        return np.asarray(vectors[:, values < 0.5])

    def nominal(self, theta: Array) -> Array:
        """The parameters where only what has no prior is not as the model says."""
        return np.asarray(self.free @ (self.free.T @ theta))

    def is_free(self, direction: Array) -> bool:
        """Whether most of a direction (n,) has no prior any more."""
        v = direction / np.linalg.norm(direction)
        return bool(np.linalg.norm(self.free.T @ v) > np.sqrt(0.5))

    def lifted(self, *directions: Array) -> Parameters:
        """The parameters without a prior along further directions (n,), and along all that were lifted before.

        They need not be at right angles to one another: all that they span is free, as "this mass" and "all masses together"
        ask for.
        """
        basis = scipy.linalg.orth(np.column_stack([self.free, *directions]))
        free = basis @ basis.T
        return replace(self, precision=np.eye(self.n) - free + LOOSE * free)
