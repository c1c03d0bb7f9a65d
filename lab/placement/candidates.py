"""Candidates: where sensors and actuators could go, which must stay, and what each would feel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import combinations

import numpy as np

from identification.recording import DERIVATIVE, Array
from lab.errors import LabError, UnknownNameError
from lab.rig import Rig


@dataclass(frozen=True, eq=False)
class Candidates:
    """Sensors, or actuators, to choose from.

    Attributes:
        names: one per candidate.
        channels: positions of its channels among those of the rig.
        fixed: positions of those that must be chosen.
    """

    names: tuple[str, ...]
    channels: tuple[tuple[int, ...], ...]
    fixed: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.names)

    def padded(self, rows: Array) -> Array:
        """Rows of the channels of each candidate, shape (n_candidates, n_channels, n), zeros where it has fewer."""
        widest = max(len(own) for own in self.channels)
        blocks = np.zeros((len(self), widest, rows.shape[1]))
        for block, own in zip(blocks, self.channels, strict=True):
            block[: len(own)] = rows[list(own)]
        return blocks

    def named(self, chosen: Sequence[int]) -> tuple[str, ...]:
        """Names of chosen candidates."""
        return tuple(self.names[i] for i in chosen)

    def channels_of(self, chosen: Sequence[int]) -> list[int]:
        """Positions of the channels of chosen candidates."""
        return [channel for i in chosen for channel in self.channels[i]]


def sensor_candidates(
    rig: Rig,
    *,
    quantity: str | None = None,
    triaxial: bool = False,
    fixed: Sequence[str] = (),
    forbid: Sequence[str] = (),
) -> Candidates:
    """The output channels that motion can move, one by one or a three-axis sensor at a time.

    Args:
        rig: with every channel connected that may be used.
        quantity: "acceleration", "velocity" or "displacement"; all of them when None.
        triaxial: the axes of a sensor are chosen together.
        fixed: sensors or channels that must be chosen.
        forbid: sensors or channels that must not, with * and ? as wildcards.

    Raises:
        LabError: none is left, or one is both fixed and forbidden.
        UnknownNameError: no such sensor.
    """
    if quantity is not None and quantity not in DERIVATIVE:
        raise LabError(f"quantity is {quantity!r}; expected one of {', '.join(DERIVATIVE)}")
    # An axis across all motion would only record rounding errors.
    felt = set(rig.responding)
    groups: dict[str, list[int]] = {}
    for i, channel in enumerate(rig.outputs):
        if channel.name in felt and channel.quantity in ((quantity,) if quantity else DERIVATIVE):
            sensor = channel.name.rpartition(".")[0] if triaxial else ""
            groups.setdefault(sensor or channel.name, []).append(i)
    names = {name: [name, *(rig.outputs[i].name for i in own)] for name, own in groups.items()}
    return _selected("sensor", groups, names, fixed, forbid)


def actuator_candidates(rig: Rig, *, fixed: Sequence[str] = (), forbid: Sequence[str] = ()) -> Candidates:
    """The input channels, one by one; arguments as for `sensor_candidates`."""
    groups = {channel.name: [i] for i, channel in enumerate(rig.inputs)}
    return _selected("actuator", groups, {name: [name] for name in groups}, fixed, forbid)


def require_known(rig: Rig, fixed: Sequence[str], forbid: Sequence[str]) -> None:
    """Check that every name asked for is that of some sensor, channel or actuator.

    Raises:
        UnknownNameError: one is not.
    """
    channels = [channel.name for channel in (*rig.outputs, *rig.inputs)]
    known = [*channels, *(name.rpartition(".")[0] for name in channels)]
    for name in (*fixed, *forbid):
        if not any(fnmatchcase(each, name) for each in known if each):
            raise UnknownNameError(
                f"{name!r} is neither a sensor nor an actuator of model {rig.name!r}; there are {', '.join(channels)}"
            )


def _selected(
    what: str,
    groups: dict[str, list[int]],
    aliases: dict[str, list[str]],
    fixed: Sequence[str],
    forbid: Sequence[str],
) -> Candidates:
    barred = {n for n, own in aliases.items() if any(fnmatchcase(a, p) for a in own for p in forbid)}
    must = [n for n, own in aliases.items() if any(a in fixed for a in own)]
    both = [name for name in must if name in barred]
    if both:
        raise LabError(f"{what} {both[0]!r} is both fixed and forbidden; leave it out of one of the two")
    kept = [name for name in groups if name not in barred]
    return Candidates(
        tuple(kept), tuple(tuple(groups[name]) for name in kept), tuple(kept.index(name) for name in must)
    )


def require_number(what: str, n: int, candidates: Candidates) -> None:
    """Check that n of the candidates can be chosen.

    Raises:
        LabError: there are fewer, or more are fixed.
    """
    if not max(len(candidates.fixed), 1) <= n <= len(candidates):
        raise LabError(
            f"{n} {what}s asked for, of {len(candidates)} candidates with {len(candidates.fixed)} fixed; expected "
            f"{max(len(candidates.fixed), 1)} to {len(candidates)}"
        )


def subsets(n: int, size: int, fixed: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Every choice of so many of n candidates, the fixed ones among them, each in rising order."""
    free = [i for i in range(n) if i not in fixed]
    for rest in combinations(free, size - len(fixed)):
        yield tuple(sorted((*fixed, *rest)))


def motion_rows(rig: Rig) -> Array:
    """Reading of each output per unit of its own derivative of motion, shape (n_outputs, n_dofs); none of other signals."""
    n = len(rig.dofs)
    position = {dof: k for k, dof in enumerate(rig.dofs)}
    rows, several = np.zeros((len(rig.outputs), n)), []
    for i, channel in enumerate(rig.outputs):
        if channel.dof in position and channel.quantity in DERIVATIVE:
            rows[i, position[channel.dof]] = channel.factor
        elif channel.quantity in DERIVATIVE and channel.name in rig.responding:
            several.append((i, DERIVATIVE[channel.quantity]))
    if several:
        system, M = rig.force_response(), rig.second_order().mass
        for i, derivative in several:
            # A reading of acceleration feels a force at once: D = C_a M⁻¹.
            rows[i] = (system.C[i, :n], system.C[i, n : 2 * n], system.D[i] @ M)[derivative]
    return rows


def force_columns(rig: Rig) -> Array:
    """Force on each degree of freedom per unit of each input, shape (n_dofs, n_inputs)."""
    n = len(rig.dofs)
    return np.asarray(rig.second_order().mass @ rig.state_space().B[n : 2 * n])
