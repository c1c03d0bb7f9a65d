"""Scale: complex factors on frequency responses that nobody knows, fitted along."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array
from identification.response import SCALES
from lab.diagnosis.spectral.transfer import Complex

LOOSE = 1e3
"""Prior standard deviation of a factor in units of its first estimate: none to speak of."""


@dataclass(frozen=True, eq=False)
class Scale:
    """Which responses share an unknown factor, and about how large it is.

    Its nuisances are the real and the imaginary part of every factor over its estimate, less one.

    Attributes:
        group: number of the factor on each response, -1 for none, (n_outputs, n_inputs).
        estimate: of every factor, (n_factors,).
    """

    group: NDArray[np.intp]
    estimate: Complex

    @classmethod
    def of(cls, scale: str, n_outputs: int, n_inputs: int) -> Scale:
        """The unknown factors that a word of `SCALES` stands for, all estimated at one."""
        known, per_input, per_response = SCALES
        group = {
            known: np.full((n_outputs, n_inputs), -1),
            per_input: np.tile(np.arange(n_inputs), (n_outputs, 1)),
            per_response: np.arange(n_outputs * n_inputs).reshape(n_outputs, n_inputs),
        }[scale]
        return cls(group, np.ones(group.max(initial=-1) + 1, dtype=complex))

    @property
    def n(self) -> int:
        """Number of nuisances."""
        return 2 * self.estimate.size

    def applied(self, H: Complex, nuisance: Array) -> Complex:
        """Responses (n_f, n_outputs, n_inputs) times their factors."""
        return np.asarray(H * self._spread(self.estimate * self._relative(nuisance)))

    def slopes(self, H: Complex) -> Complex:
        """Derivative of the scaled responses by every nuisance, (n, *H.shape)."""
        found = []
        for number, estimate in enumerate(self.estimate):
            own = np.where(self.group == number, estimate * H, 0)
            found += [own, 1j * own]
        return np.array(found, dtype=complex).reshape(self.n, *H.shape)

    def fitted(self, H: Complex, values: Complex, spread: Array) -> Array:
        """Nuisances at which weighted least squares brings responses closest to measured ones.

        Source: Golub and Pereyra (1973), SIAM J. Numer. Anal. 10, 413-432: variables that enter linearly are eliminated.
        """
        found = np.zeros(self.n)
        for number, estimate in enumerate(self.estimate):
            own = np.broadcast_to(self.group == number, H.shape)
            h, y = (H / spread)[own], (values / spread)[own]
            c = np.vdot(h, y) / max(np.vdot(h, h).real, 1e-300) / estimate - 1
            found[2 * number : 2 * number + 2] = c.real, c.imag
        return found

    def estimated(self, H: Complex, values: Complex) -> Scale:
        """The scale with estimates as large as measured responses are over the model's, in phase with them."""
        unit = replace(self, estimate=np.ones(self.estimate.size, dtype=complex))
        turned = unit._relative(unit.fitted(H, values, np.ones(H.shape)))
        sizes = []
        for number in range(self.estimate.size):
            own = np.broadcast_to(self.group == number, H.shape)
            sizes.append(np.linalg.norm(values[own]) / np.linalg.norm(H[own]) if np.any(H[own]) else 1.0)
        return replace(self, estimate=np.array(sizes) * np.exp(1j * np.angle(turned)))

    def _relative(self, nuisance: Array) -> Complex:
        return np.asarray(1 + nuisance[0::2] + 1j * nuisance[1::2])

    def _spread(self, factors: Complex) -> Complex:
        return np.where(self.group < 0, 1.0, np.append(factors, 1.0)[self.group])
