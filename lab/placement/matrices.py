"""Target "matrices": the layouts that can recover M, C and K, ranked by the least scatter that each allows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
import scipy.linalg

from identification.information import planned as planned_test
from identification.layout_information import LayoutInformation, layout_information
from identification.recording import DERIVATIVE, Array
from identification.structures import free_matrices
from lab.errors import LabError
from lab.placement.candidates import Candidates, require_number
from lab.placement.outcome import Drive, Placement, Ranked
from lab.placement.plan import Plan, alternatives, peak, total_duration
from lab.rig import Rig

LIMIT = 50_000
"""Possible layouts up to this number are all compared, which proves the best."""
LOOKED_AT = 5_000_000
"""Layouts up to this number are looked through for possible ones."""
MAX_PARAMETERS = 700
"""Entries of M, C and K: beyond, one layout alone takes seconds."""
STARTS = 4
TOLD = 5
"""Best layouts that are told by name."""
ROUNDING = 1e11
"""Variance inflation above which rounding decides, so that the layout counts as blind."""

Choice = tuple[tuple[int, ...], tuple[int, ...]]
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

    def possible(self, choice: Choice) -> bool:
        """Whether every degree of freedom has a sensor or an actuator, and one has both."""
        sensed, driven = self.held(choice)
        return bool(np.all(sensed | driven) and np.any(sensed & driven))

    def held(self, choice: Choice) -> tuple[np.ndarray, np.ndarray]:
        """Whether each degree of freedom has a sensor, and whether it has an actuator."""
        read = {self.rig.outputs[i].dof for i in self.sensors.channels_of(choice[0])}
        driven = {self.rig.inputs[i].dof for i in self.actuators.channels_of(choice[1])}
        return tuple(np.array([dof in side for dof in self.rig.dofs]) for side in (read, driven))  # type: ignore[return-value]

    def figure(self, choice: Choice) -> float:
        """The criterion; infinite for a layout that cannot give M, C and K."""
        if not self.possible(choice):
            return np.inf
        return figure(self.by_sensor(choice[1])[list(choice[0])].sum(axis=0), self.criterion)


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


def place_matrices(
    rig: Rig,
    sensors: Candidates,
    actuators: Candidates,
    n_sensors: int,
    n_actuators: int,
    plan: Plan,
    *,
    criterion: str = "a",
    planned: Choice | None = None,
    limit: int = LIMIT,
) -> Placement:
    """The layout that allows the least scatter of M, C and K, and its rivals.

    Args:
        rig: with every candidate channel connected.
        sensors, actuators: candidates.
        n_sensors, n_actuators: how many to choose.
        plan: the test.
        criterion: "a", "d" or "e", as in `MEASURES`.
        planned: sensors and actuators of a layout to be ranked too.
        limit: number of possible layouts up to which all are compared.

    Raises:
        LabError: no layout of these candidates can give M, C and K, or there are too many entries.

    Source: De Angelis et al. (2002), J. Appl. Mech. 69, section 3, for the layouts that can; Kay (1993), eq. (3.20), for
    the least scatter.
    """
    contest = _contest(rig, sensors, actuators, n_sensors, n_actuators, plan, criterion)
    n_layouts = comb(len(sensors) - len(sensors.fixed), n_sensors - len(sensors.fixed)) * comb(
        len(actuators) - len(actuators.fixed), n_actuators - len(actuators.fixed)
    )
    choices = possible_layouts(contest) if n_layouts <= LOOKED_AT else []
    proven = n_layouts <= LOOKED_AT and len(choices) <= limit
    if proven:
        if not choices:
            raise LabError(_impossible(contest))
        figures = np.array(list(_figures(contest, choices)))
        order = np.argsort(figures, kind="stable")
        best = choices[order[0]]
    else:
        figures, order = np.zeros(0), np.zeros(0, dtype=int)
        best = _searched(contest)
    ranking = [_ranked("best", contest, best, figures)]
    ranking += [
        _ranked(f"rank {k + 1}", contest, choices[order[k]], figures) for k in range(1, min(TOLD, len(order)))
    ]
    if planned is not None:
        ranking.append(_ranked("planned", contest, planned, figures))
    finite = figures[np.isfinite(figures)]
    if finite.size > 1:
        ranking.append(_ranked("worst", contest, choices[order[finite.size - 1]], figures))
    if not np.isfinite(ranking[0].figure):
        raise LabError(
            "no layout tells all entries of M, C and K in the planned test; excite more modes or record longer"
        )
    return Placement(
        "matrices",
        rig.name,
        criterion,
        MEASURES[criterion],
        ranking[0].sensors,
        ranking[0].actuators,
        ranking[0].figure,
        proven,
        ranking[0].figure if proven else None,
        n_layouts,
        len(choices) if n_layouts <= LOOKED_AT else n_layouts,
        np.sort(finite),
        tuple(ranking),
        drives=tuple(_drives(contest, best)),
        warnings=tuple(_warnings(contest, n_layouts, proven)),
    )


def possible_layouts(contest: Contest) -> list[Choice]:
    """Every layout that can recover M, C and K: a sensor or an actuator on every degree of freedom, one with both."""
    found: list[Choice] = []
    sets = [
        (chosen, contest.held((chosen, ()))[0])
        for chosen in _subsets(len(contest.sensors), contest.n_sensors, contest.sensors.fixed)
    ]
    sensed = np.array([held for _, held in sets]).reshape(-1, len(contest.rig.dofs))
    for driving in _subsets(len(contest.actuators), contest.n_actuators, contest.actuators.fixed):
        driven = contest.held(((), driving))[1]
        fits = np.all(sensed | driven, axis=1) & np.any(sensed & driven, axis=1)
        found += [(sets[i][0], driving) for i in np.flatnonzero(fits)]
    return found


def _contest(
    rig: Rig,
    sensors: Candidates,
    actuators: Candidates,
    n_sensors: int,
    n_actuators: int,
    plan: Plan,
    criterion: str,
) -> Contest:
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
    return Contest(rig, plan, sensors, actuators, n_sensors, n_actuators, criterion, *_known(rig, plan))


def _known(rig: Rig, plan: Plan) -> tuple[LayoutInformation, Array]:
    """Information of all candidates, and the unit of each entry."""
    structure = rig.second_order()
    signals = plan.signals(rig)
    test = planned_test([u for _, u in signals], rig.inputs, rig.outputs, sample_rate=plan.sample_rate)
    known = layout_information(structure, test, free_matrices(rig.dofs))
    each = len(known.names) // 3
    largest = [np.max(np.abs(x)) for x in (structure.mass, structure.damping, structure.stiffness)]
    return known, np.repeat(largest, each)


def _subsets(n: int, size: int, fixed: Sequence[int]) -> Iterator[tuple[int, ...]]:
    free = [i for i in range(n) if i not in fixed]
    for rest in combinations(free, size - len(fixed)):
        yield tuple(sorted((*fixed, *rest)))


def _figures(contest: Contest, choices: Sequence[Choice]) -> Iterator[float]:
    """The figure of each choice; those with the same actuators side by side share their work."""
    driving, each = None, np.zeros(())
    for sensors, actuators in choices:
        if actuators != driving:
            driving, each = actuators, contest.by_sensor(actuators)
        yield figure(each[list(sensors)].sum(axis=0), contest.criterion)


def _searched(contest: Contest) -> Choice:
    """A good layout where there are too many to compare: exchanges of one sensor or actuator from several starts."""
    rng, found = np.random.default_rng(0), []
    for _ in range(STARTS):
        here = _any_possible(contest, rng)
        value = contest.figure(here)
        while True:
            best, there = min(
                ((contest.figure(near), near) for near in _neighbours(contest, here)), default=(value, here)
            )
            if not best < value:
                break
            value, here = best, there
        found.append((value, here))
    return min(found)[1]


def _neighbours(contest: Contest, choice: Choice) -> Iterator[Choice]:
    """Possible layouts that differ in one sensor or one actuator."""
    for side, candidates in enumerate((contest.sensors, contest.actuators)):
        for old in set(choice[side]) - set(candidates.fixed):
            for new in set(range(len(candidates))) - set(choice[side]):
                changed = tuple(sorted({*choice[side], new} - {old}))
                near = (changed, choice[1]) if side == 0 else (choice[0], changed)
                if contest.possible(near):
                    yield near


def _any_possible(contest: Contest, rng: np.random.Generator) -> Choice:
    """A possible layout at random: actuators first, then sensors on what they leave bare and on one that they drive."""
    for _ in range(1000):
        sides: list[tuple[int, ...]] = []
        for candidates, n in ((contest.actuators, contest.n_actuators), (contest.sensors, contest.n_sensors)):
            free = rng.permutation([i for i in range(len(candidates)) if i not in candidates.fixed])
            if sides:
                driven = contest.held(((), sides[0]))[1]
                dofs = [contest.rig.outputs[candidates.channels[i][0]].dof for i in free]
                bare = {dof for dof, is_driven in zip(contest.rig.dofs, driven, strict=True) if not is_driven}
                first = [i for k, i in enumerate(free) if dofs[k] in bare and dofs[k] not in dofs[:k]]
                free = np.array([*first, *(i for i in free if i not in first)])
            sides.append(
                tuple(sorted(int(i) for i in (*candidates.fixed, *free[: n - len(candidates.fixed)])))
            )
        if contest.possible((sides[1], sides[0])):
            return sides[1], sides[0]
    raise LabError(_impossible(contest))


def _impossible(contest: Contest) -> str:
    n = len(contest.rig.dofs)
    return (
        f"no layout of {contest.n_sensors} sensors and {contest.n_actuators} actuators among these candidates can give M, C "
        f"and K of {n} degrees of freedom; expected at least {n + 1} channels in all, a sensor or an actuator on every "
        "degree of freedom and one with both"
    )


def _ranked(name: str, contest: Contest, choice: Choice, figures: Array) -> Ranked:
    sensors, actuators = choice
    possible = contest.possible(choice)
    information = contest.by_sensor(actuators)[list(sensors)].sum(axis=0)
    details = {kind: figure(information, kind) if possible else np.inf for kind in MEASURES}
    own = details[contest.criterion]
    rank = int(np.sum(figures < own * (1 - 1e-9))) + 1 if figures.size and np.isfinite(own) else None
    if np.isfinite(own):
        variance = np.diag(np.linalg.inv(information))
        parts = np.split(np.sqrt(variance), 3)
        details |= {
            matrix: float(np.sqrt(np.mean(part**2)))
            for matrix, part in zip(("mass", "damping", "stiffness"), parts, strict=True)
        }
    return Ranked(
        name, contest.sensors.named(sensors), contest.actuators.named(actuators), own, rank, details
    )


def _drives(contest: Contest, best: Choice) -> Iterator[Drive]:
    """The best layout under other signals of the same largest force, with the noise that it has in the planned test."""
    rig, plan = contest.rig, contest.plan
    inputs, outputs = contest.actuators.channels_of(best[1]), contest.sensors.channels_of(best[0])
    std = plan.noise_std(rig.outputs, contest.known.rms(inputs))
    usual = np.mean(np.where(np.isfinite(std), std, 0.0), axis=0) / np.maximum(
        np.mean(np.isfinite(std), axis=0), 1e-300
    )
    usual = np.where(usual > 0, usual, np.inf)
    for kind, other in alternatives(rig, plan, rig.second_order().modes().frequency_hz):
        known, units = _known(rig, other)
        each = known.of_outputs(inputs, np.broadcast_to(usual, known.rms(inputs).shape))
        information = each[outputs].sum(axis=0) * units * units[:, None]
        signals = [(name, u[inputs]) for name, u in other.signals(rig)]
        length = total_duration(signals, other.sample_rate)
        yield Drive(kind, length, peak(signals), figure(information, contest.criterion))


def _warnings(contest: Contest, n_layouts: int, proven: bool) -> Iterator[str]:
    if not proven:
        yield (
            f"of {n_layouts:.3g} layouts only some were compared, by exchanges from {STARTS} starts: the best one found is not "
            "proven; fix or forbid channels to compare all"
        )
    if not contest.plan.noise:
        yield (
            f"noise is {contest.plan.noise_percent:g} % of the RMS of each output, whatever moves it: sensors where little "
            "moves are as good as others; give the noise of your sensors by unit if you know it"
        )
