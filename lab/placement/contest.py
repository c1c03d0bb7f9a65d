"""Contest: the layouts that can recover M, C and K, and what each of them is worth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.information import planned as planned_test
from identification.layout_information import LayoutInformation, layout_information
from identification.recording import DERIVATIVE, Array
from identification.structures import free_matrices
from lab.errors import LabError
from lab.placement.candidates import Candidates, require_number, subsets
from lab.placement.plan import Plan
from lab.rig import Rig

MAX_PARAMETERS = 700
"""Entries of M, C and K: beyond, one layout alone takes seconds."""
ROUNDING = 1e11
"""Variance inflation above which rounding decides, so that the layout counts as blind."""

Layout = tuple[tuple[int, ...], tuple[int, ...]]
"""Sensors and actuators, as positions among the candidates."""

MEASURES = {
    "a": "root mean square of the standard deviations of all entries, each relative to the largest of its matrix",
    "d": "geometric mean of the standard deviations of all entries, each relative to the largest of its matrix",
    "e": "standard deviation of the worst combination of entries, each relative to the largest of its matrix",
}


@dataclass(frozen=True, eq=False)
class Contest:
    """All layouts of candidates, and what each of them is worth.

    Attributes:
        rig: with every candidate channel connected.
        plan: the test.
        sensors, actuators: candidates.
        n_sensors, n_actuators: how many to choose.
        criterion: "a", "d" or "e".
        known: information of all candidates.
        units: largest entry of the matrix of each parameter, shape (n_parameters,).
    """

    rig: Rig
    plan: Plan
    sensors: Candidates
    actuators: Candidates
    n_sensors: int
    n_actuators: int
    criterion: str
    known: LayoutInformation
    units: Array

    def by_sensor(self, actuators: Sequence[int]) -> Array:
        """Information of each candidate sensor with these actuators, in units of the entries; (n_sensors, n, n)."""
        inputs = self.actuators.channels_of(actuators)
        std = self.plan.noise_std(self.rig.outputs, self.known.rms(inputs))
        each = self.known.of_outputs(inputs, std)
        summed = np.stack([each[list(own)].sum(axis=0) for own in self.sensors.channels])
        return np.asarray(summed * self.units * self.units[:, None])

    def possible(self, layout: Layout) -> bool:
        """Whether every degree of freedom has a sensor or an actuator, and one has both."""
        sensed, driven = self.held(layout)
        return bool(np.all(sensed | driven) and np.any(sensed & driven))

    def held(self, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
        """Whether each degree of freedom has a sensor, and whether it has an actuator."""
        read = {self.rig.outputs[i].dof for i in self.sensors.channels_of(layout[0])}
        driven = {self.rig.inputs[i].dof for i in self.actuators.channels_of(layout[1])}
        return tuple(np.array([dof in side for dof in self.rig.dofs]) for side in (read, driven))  # type: ignore[return-value]


def figure(information: Array, criterion: str) -> float:
    """Value of the criterion for an information in units of the entries; infinite where it is blind for one.

    Args:
        information: shape (n_parameters, n_parameters).
        criterion: "a", "d" or "e", as in `MEASURES`.
    """
    scale = np.sqrt(np.diag(information))
    if not np.all(scale > 0):
        return np.inf
    factor, failed = scipy.linalg.lapack.dpotrf(information / scale / scale[:, None], lower=1)
    if failed:
        return np.inf
    inverse = scipy.linalg.lapack.dpotri(factor, lower=1)[0]
    if np.max(np.diag(inverse)) > ROUNDING:
        return np.inf
    if criterion == "a":
        return float(np.sqrt(np.mean(np.diag(inverse) / scale**2)))
    if criterion == "d":
        return float(np.exp(-np.mean(np.log(np.diag(factor) * scale))))
    lower = np.tril(inverse)
    covariance = (lower + np.tril(lower, -1).T) / scale / scale[:, None]
    return float(np.sqrt(scipy.linalg.eigvalsh(covariance)[-1]))


def contest_of(
    rig: Rig,
    sensors: Candidates,
    actuators: Candidates,
    n_sensors: int,
    n_actuators: int,
    plan: Plan,
    criterion: str,
) -> Contest:
    """The contest of these candidates.

    Raises:
        LabError: impossible numbers, a channel that feels several degrees of freedom, or too many entries.
    """
    if criterion not in MEASURES:
        raise LabError(f"criterion is {criterion!r}; expected {', '.join(MEASURES)} for the target matrices")
    require_number("sensor", n_sensors, sensors)
    require_number("actuator", n_actuators, actuators)
    n = len(rig.dofs)
    if 3 * n * (n + 1) // 2 > MAX_PARAMETERS:
        raise LabError(
            f"M, C and K of {n} degrees of freedom have {3 * n * (n + 1) // 2} entries; expected up to {MAX_PARAMETERS}; "
            "place for modes instead"
        )
    astray = [
        channel.name
        for channel, is_output in (
            *((rig.outputs[i], True) for own in sensors.channels for i in own),
            *((rig.inputs[i], False) for own in actuators.channels for i in own),
        )
        if channel.dof not in rig.dofs or (is_output and channel.quantity not in DERIVATIVE)
    ]
    if astray:
        raise LabError(
            f"channel {astray[0]!r} feels more than one degree of freedom; forbid it, since M, C and K need one each"
        )
    return Contest(rig, plan, sensors, actuators, n_sensors, n_actuators, criterion, *known_of(rig, plan))


def known_of(rig: Rig, plan: Plan) -> tuple[LayoutInformation, Array]:
    """Information of all candidates, and the unit of each entry."""
    structure = rig.second_order()
    signals = plan.signals(rig)
    test = planned_test([u for _, u in signals], rig.inputs, rig.outputs, sample_rate=plan.sample_rate)
    known = layout_information(structure, test, free_matrices(rig.dofs))
    each = len(known.names) // 3
    largest = [np.max(np.abs(x)) for x in (structure.mass, structure.damping, structure.stiffness)]
    return known, np.repeat(largest, each)


def possible_layouts(contest: Contest) -> list[Layout]:
    """Every layout that can recover M, C and K: a sensor or an actuator on every degree of freedom, one with both."""
    found: list[Layout] = []
    sets = [
        (chosen, contest.held((chosen, ()))[0])
        for chosen in subsets(len(contest.sensors), contest.n_sensors, contest.sensors.fixed)
    ]
    sensed = np.array([held for _, held in sets]).reshape(-1, len(contest.rig.dofs))
    for driving in subsets(len(contest.actuators), contest.n_actuators, contest.actuators.fixed):
        driven = contest.held(((), driving))[1]
        fits = np.all(sensed | driven, axis=1) & np.any(sensed & driven, axis=1)
        found += [(sets[i][0], driving) for i in np.flatnonzero(fits)]
    return found


def figures_of(contest: Contest, layouts: Sequence[Layout]) -> Iterator[float]:
    """The figure of each layout; those with the same actuators side by side share their work."""
    driving, each = None, np.zeros(())
    for sensors, actuators in layouts:
        if actuators != driving:
            driving, each = actuators, contest.by_sensor(actuators)
        yield figure(each[list(sensors)].sum(axis=0), contest.criterion)


def impossible(contest: Contest) -> str:
    """What to say when no layout can recover M, C and K."""
    n = len(contest.rig.dofs)
    return (
        f"no layout of {contest.n_sensors} sensors and {contest.n_actuators} actuators among these candidates can give M, C "
        f"and K of {n} degrees of freedom; expected at least {n + 1} channels in all, a sensor or an actuator on every "
        "degree of freedom and one with both"
    )
