"""A sampled system as its modes: eigenvalues, shapes, participations, and real blocks for each pair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.modes import Modes
from identification.recording import Array, Channel
from identification.systems import MarkovParameters, StateSpace

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class ModalRealization:
    """A sampled system in complex modal coordinates: Y(k) = Ψ Λᵏ L from lag 1 on, and D at lag 0.

    Attributes:
        z: eigenvalues, conjugates side by side, by rising angle, shape (n_states,).
        shapes: Ψ, shape (n_outputs, n_states).
        participation: L, shape (n_states, n_inputs).
        direct: D, shape (n_outputs, n_inputs).
        dt: sample time [s].
        inputs: input channels.
        outputs: output channels.
    """

    z: Complex
    shapes: Complex
    participation: Complex
    direct: Array
    dt: float
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]

    def markov(self, n_lags: int) -> MarkovParameters:
        """The first `n_lags` Markov parameters.

        Source: Juang (1992), thesis, eq. (4.1).
        """
        powers = self.z ** np.arange(n_lags - 1)[:, None]
        later = np.real((self.shapes * powers[:, None, :]) @ self.participation)
        return MarkovParameters(
            np.concatenate([self.direct[None], later])[:n_lags], self.dt, self.inputs, self.outputs
        )

    def modes(self) -> Modes:
        """Oscillating modes, one for each conjugate pair.

        Source: Juang (1992), thesis, eq. (4.30).
        """
        own = self.z.imag > 0
        return Modes.from_poles(
            np.asarray(np.log(self.z[own]) / self.dt, dtype=complex), self.shapes[:, own], self.outputs
        )

    def real(self) -> StateSpace:
        """The same system in real modal coordinates: a 2 x 2 block per pair, phases from the first output.

        Source: Juang (1992), thesis, eq. (C.2) to (C.4).
        """
        own = np.flatnonzero(self.z.imag >= 0)
        blocks, shapes, participation = [], [], []
        for k in own:
            z, psi, part = self.z[k], self.shapes[:, k], self.participation[k]
            if z.imag == 0:
                blocks.append(np.array([[z.real]]))
                shapes.append(psi.real[:, None])
                participation.append(part.real[None])
                continue
            phase = np.exp(1j * np.angle(psi[0]))
            psi, part = psi / phase, part * phase
            blocks.append(np.array([[z.real, -z.imag], [z.imag, z.real]]))
            shapes.append(np.stack([psi.real, -psi.imag], axis=1))
            participation.append(2 * np.stack([part.real, part.imag]))
        return StateSpace(
            scipy.linalg.block_diag(*blocks),
            np.vstack(participation),
            np.hstack(shapes),
            self.direct,
            self.dt,
            self.inputs,
            self.outputs,
        )

    @classmethod
    def sorted(
        cls, z: Complex, shapes: Complex, participation: Complex, markov: MarkovParameters
    ) -> ModalRealization:
        """From eigenvalues in any order, with D and the channels of the data."""
        own = np.flatnonzero(z.imag >= 0)
        own = own[np.argsort(np.angle(z[own]), kind="stable")]
        pick = np.concatenate([[k, ~k] if z[k].imag else [k] for k in own])

        def spread(x: Complex) -> Complex:
            # The conjugate is taken, not solved for: it is one to the last digit.
            return np.asarray(np.where(pick >= 0, x[..., pick], x[..., ~pick].conj()))

        return cls(
            spread(z),
            spread(shapes),
            spread(participation.T).T,
            markov.values[0],
            markov.dt,
            markov.inputs,
            markov.outputs,
        )
