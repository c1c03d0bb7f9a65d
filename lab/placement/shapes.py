"""Shapes: the modes of a structure as sensors see them, and the actuators that drive them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.linalg

from identification.recording import DERIVATIVE, Array
from lab.errors import LabError
from lab.placement.candidates import Candidates, force_columns, motion_rows, require_number
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


def sensor_shapes(rig: Rig, omega: Array, shapes: Array, noise: Mapping[str, float]) -> Array:
    """Reading of each output per unit of each modal coordinate, in its noise where that is given; (n_outputs, n_modes).

    Raises:
        LabError: outputs of several quantities, and no noise to compare them by.
    """
    rows = motion_rows(rig) @ shapes
    felt = [channel for channel in rig.outputs if channel.quantity in DERIVATIVE]
    if noise:
        std = np.array([noise.get(channel.unit, np.nan) for channel in rig.outputs])
        lacking = {channel.unit for channel in felt if channel.unit not in noise}
        if lacking:
            raise LabError(
                f"no noise is given for sensors in {', '.join(sorted(lacking))}; expected one number for each unit"
            )
        power = np.array([DERIVATIVE.get(channel.quantity, 0) for channel in rig.outputs])
        return np.asarray(np.nan_to_num(rows * omega ** power[:, None] / std[:, None]))
    return np.asarray(rows)


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
