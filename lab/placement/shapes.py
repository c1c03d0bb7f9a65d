"""Shapes: the modes of a structure as sensors see them, and the actuators that drive them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.linalg

from identification.recording import DERIVATIVE, Array
from lab.placement.candidates import Candidates, force_columns, require_number
from lab.placement.choice import LIMIT, choose
from lab.placement.criteria import CRITERIA
from lab.rig import Rig

RIGID = 1e-9
"""A mode whose stiffness is below this share of the largest moves the structure as a whole."""


def normal_modes(rig: Rig) -> tuple[Array, Array]:
    """Angular frequencies [rad/s], rising, and shapes of unit modal mass (n_dofs, n_modes); rigid ones left out.

    Undamped: where sensors see modes does not hang on how these decay.
    """
    structure = rig.second_order()
    values, shapes = scipy.linalg.eigh(structure.stiffness, structure.mass)
    flexible = values > RIGID * values[-1]
    return np.sqrt(values[flexible]), shapes[:, flexible]


def sensor_shapes(rig: Rig, readings: Array, omega: Array, noise: Mapping[str, float]) -> Array:
    """Reading of each output per unit of each modal coordinate, over its noise; (n_outputs, n_modes).

    Args:
        rig: structure.
        readings: of each output per unit of its own derivative of each modal coordinate, (n_outputs, n_modes).
        omega: natural angular frequencies [rad/s].
        noise: standard deviation by unit; where empty, outputs are of one quantity and equally noisy.
    """
    if not noise:
        return readings
    std = np.array([noise.get(channel.unit, np.inf) for channel in rig.outputs])
    power = np.array([DERIVATIVE.get(channel.quantity, 0) for channel in rig.outputs])
    return np.asarray(readings * omega ** power[:, None] / std[:, None])


def choose_actuators(
    rig: Rig, actuators: Candidates, n: int, *, n_modes: int | None = None, limit: int = LIMIT
) -> tuple[int, ...]:
    """The actuators with which the force on the faintest of the lowest modes is largest; all modes when None."""
    if not n:
        return ()
    require_number("actuator", n, actuators)
    shapes = normal_modes(rig)[1][:, :n_modes]
    participation = actuators.padded((shapes.T @ force_columns(rig)).T)
    # Each mode in units of what all actuators together do to it.
    size = np.sqrt(np.sum(participation**2, axis=(0, 1)))
    participation = participation / np.where(size > 0, size, 1.0)
    grams = np.einsum("bcm,bcn->bmn", participation, participation)
    return choose(grams, n, CRITERIA["visibility"], fixed=actuators.fixed, limit=limit).chosen
