"""Who is instrumented: which degree of freedom has a sensor, which an actuator, and what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import NotSecondOrderError
from identification.recording import DERIVATIVE, Channel


@dataclass(frozen=True, eq=False)
class Layout:
    """Sensors and actuators sorted by degree of freedom.

    Attributes:
        dofs: names of the degrees of freedom.
        sensors: positions of the outputs that read each one, and what they read.
        actuators: positions of the inputs that drive each one.
    """

    dofs: tuple[str, ...]
    sensors: tuple[tuple[int, ...], ...]
    actuators: tuple[tuple[int, ...], ...]

    @property
    def sensed(self) -> NDArray[np.bool_]:
        """Whether each degree of freedom has a sensor, shape (n_dofs,)."""
        return np.array([bool(rows) for rows in self.sensors])

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Whether each degree of freedom has an actuator, shape (n_dofs,)."""
        return np.array([bool(columns) for columns in self.actuators])


def layout(
    outputs: Sequence[Channel], inputs: Sequence[Channel], *, dofs: Sequence[str] | None = None
) -> Layout:
    """Sensors and actuators by degree of freedom, where they suffice to find mass, damping and stiffness.

    Args:
        outputs: channels; those without `dof`, or that measure no motion, are left aside.
        inputs: channels; those without `dof` are left aside.
        dofs: names in the order wanted; first appearance among the outputs, then the inputs, when None.

    Returns:
        Who is instrumented, in the order of the degrees of freedom.

    Raises:
        NotSecondOrderError: a degree of freedom has neither sensor nor actuator, none has both, or a channel
            contradicts `dofs`; says what to add.

    Source: De Angelis et al. (2002), section 3: each degree of freedom has a sensor or an actuator, one
    has both.
    """
    read = [channel.dof if channel.quantity in DERIVATIVE else "" for channel in outputs]
    driven = [channel.dof for channel in inputs]
    known = tuple(dict.fromkeys(dof for dof in (*read, *driven) if dof))
    names = known if dofs is None else tuple(dofs)
    bare = [dof for dof in names if dof not in known]
    if bare:
        raise NotSecondOrderError(
            f"not identifiable from this layout: {_listed(bare)} neither sensor nor actuator; "
            "add one of the two on each"
        )
    if not known:
        raise NotSecondOrderError(
            "no channel says which degree of freedom it reads or drives; set `dof` of the channels, in the recipe of the import"
        )
    outside = [dof for dof in known if dof not in names]
    if outside:
        raise NotSecondOrderError(
            f"channels read or drive {', '.join(outside)}, which is not among the degrees of freedom asked "
            f"for "
            f"({', '.join(names)}); add it to them"
        )
    pairs = set(read) & set(driven) - {""}
    if not pairs:
        raise NotSecondOrderError(
            f"not identifiable from this layout: no degree of freedom has both a sensor (on "
            f"{_joined(read)}) and an "
            f"actuator (on {_joined(driven)}); add a sensor next to an actuator, or an actuator next to a "
            f"sensor"
        )
    for channel in (*outputs, *inputs):
        if channel.dof and not (np.isfinite(channel.factor) and channel.factor):
            raise NotSecondOrderError(
                f"channel {channel.name!r} has the factor {channel.factor}; expected a finite number other "
                f"than zero"
            )
    return Layout(names, _positions(read, names), _positions(driven, names))


def _positions(dofs: Sequence[str], names: Sequence[str]) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(i for i, dof in enumerate(dofs) if dof == name) for name in names)


def _joined(dofs: Sequence[str]) -> str:
    return ", ".join(dict.fromkeys(dof for dof in dofs if dof)) or "none"


def _listed(dofs: Sequence[str]) -> str:
    return f"DOF {dofs[0]} has" if len(dofs) == 1 else f"DOFs {', '.join(dofs)} have"
