"""Continuous: the frequency response of a plant to forces that vary continuously, as analysers measure it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array
from lab.diagnosis.spectral.modal_sum import ModalBasis
from lab.paths import Path
from lab.plant import Plant

Complex = NDArray[np.complex128]


def continuous_response(plant: Plant, s: Complex) -> Complex:
    """Transfer function of the plant's linear part from its inputs and then its tones, (n_s, n_outputs, n_inputs + n_tones).

    No force is held over a sample and nothing is folded: y = (L_d + s L_v + s² L_a) (M s² + C_d s + K)⁻¹ B u, with the
    gains, lags and delays of the channels as they are in continuous time. A lag that a digital filter makes is that of the
    filter's limit at ever shorter samples, and a band limit lies above all frequencies.

    Args:
        plant: structure and chain.
        s: complex frequencies [rad/s], (n_s,).

    Source: Ewins (2000), Modal Testing, 2nd ed., section 2.5, viscous damping.
    """
    return behind_channels(
        plant, read(plant, s, Receptance(plant, s).between(all_rows(plant), pushes(plant))), s
    )


def pushes(plant: Plant) -> Array:
    """Force on every degree of freedom by each input and then each tone, (n_dofs, n_inputs + n_tones)."""
    tones = np.array([tone.row for tone in plant.tones]).reshape(-1, plant.n_dofs).T
    return np.hstack([plant.forces, tones])


def all_rows(plant: Plant) -> Array:
    """Rows of all outputs: displacement, then velocity, then acceleration, (3 n_outputs, n_dofs)."""
    return np.vstack([plant.displacement, plant.velocity, plant.acceleration])


def read(plant: Plant, s: Complex, X: Complex) -> Complex:
    """Readings before any channel, (n_s, n_outputs, …), of motions along `all_rows`."""
    moved = np.split(X, 3, axis=1)
    return np.asarray(sum(s[:, None, None] ** power * each for power, each in enumerate(moved)))


def behind_channels(plant: Plant, H: Complex, s: Complex) -> Complex:
    """Responses (n_s, n_outputs, n_inputs + n_tones) with what the channels of both sides do to them."""
    pushed = np.ones((s.size, H.shape[2]), dtype=complex)
    for i, path in enumerate(plant.input_paths):
        pushed[:, i] = _through(path, s)
    H = (
        np.stack([_through(path, s) for path in plant.output_paths], axis=1)[:, :, None]
        * H
        * pushed[:, None, :]
    )
    return behind_limits(plant, H[:, list(plant.order)] if plant.order else H, s)


class Receptance:
    """(M s² + C_d s + K)⁻¹ at complex frequencies s, between any forces and rows."""

    def __init__(self, plant: Plant, s: Complex) -> None:
        n = plant.n_dofs
        # Velocities in units of a typical frequency keep the eigenvectors a good basis.
        self._omega = np.sqrt(np.linalg.norm(plant.stiffness) / np.linalg.norm(plant.mass)) or 1.0
        self._mass = plant.mass
        inverse = np.linalg.solve(plant.mass, np.hstack([plant.stiffness / self._omega, plant.damping]))
        A = np.block([[np.zeros((n, n)), self._omega * np.eye(n)], [-inverse[:, :n], -inverse[:, n:]]])
        self._basis = ModalBasis(A, s)

    def between(self, rows: Array, forces: Array) -> Complex:
        """Rows (n_rows, n_dofs) times the receptance times forces (n_dofs, m), shape (n_s, n_rows, m)."""
        B = np.vstack([np.zeros(forces.shape), np.linalg.solve(self._mass, forces / self._omega)])
        return self._basis.transfer(B, np.hstack([rows, np.zeros(rows.shape)]))


def behind_limits(plant: Plant, H: Complex, s: Complex) -> Complex:
    """Recorded responses with the lags and delays that channels have behind an ideal anti-alias filter."""
    factors = np.ones(H.shape[:2], dtype=complex)
    for i, path in enumerate(plant.output_paths):
        factors[:, i] = np.exp(-s * path.band_limited_delay) / (1 + s * path.band_limited_lag)
    return np.asarray(factors[:, :, None] * H)


def _through(path: Path, s: Complex) -> Complex:
    """What gain, lags and delay of a channel do to a sine."""
    return np.asarray(path.gain * np.exp(-s * path.delay) / ((1 + s * path.lag) * (1 + s * path.held_lag)))
