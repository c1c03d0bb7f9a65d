"""Target "matrices": the layouts that can recover M, C and K, ranked by the least scatter that each allows."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from identification.information import fisher_information
from identification.information import planned as planned_test
from identification.progress import UNHEARD, Work
from identification.recording import Array
from identification.structures import free_matrices
from lab.errors import LabError
from lab.placement.candidates import Candidates, subsets
from lab.placement.contest import (
    MEASURES,
    Contest,
    Layout,
    contest_of,
    figure,
    figures_of,
    impossible,
    possible_layouts,
)
from lab.placement.matrix_search import STARTS, searched
from lab.placement.outcome import Drive, Placement, Ranked
from lab.placement.plan import Plan, alternatives, peak, total_duration
from lab.placement.search import count
from lab.rig import Rig

WORK = 6e10
"""Possible layouts are all compared, which proves the best, while their number times that of entries cubed is below this:
half a minute."""
LOOKED_AT = 5_000_000
"""Layouts up to this number are looked through for possible ones."""
MAX_SETS = 500
"""Sets of actuators up to this number are all tried for a bound."""
TOLD = 5
"""Best layouts that are told by name."""


def place_matrices(
    rig: Rig,
    sensors: Candidates,
    actuators: Candidates,
    n_sensors: int,
    n_actuators: int,
    plan: Plan,
    *,
    criterion: str = "a",
    planned: Layout | None = None,
    limit: int | None = None,
    work: Work = UNHEARD,
) -> Placement:
    """The layout that allows the least scatter of M, C and K, and its rivals.

    Args:
        rig: with every candidate channel connected.
        sensors, actuators: candidates.
        n_sensors, n_actuators: how many to choose.
        plan: the test.
        criterion: "a", "d" or "e", as in `MEASURES`.
        planned: sensors and actuators of a layout to be ranked too.
        limit: number of possible layouts up to which all are compared; by their cost when None.
        work: told of every layout compared, or start of a search.

    Raises:
        LabError: no layout of these candidates can give M, C and K, or there are too many entries.

    Source: De Angelis et al. (2002), J. Appl. Mech. 69, section 3, for the layouts that can; Kay (1993), eq. (3.20), for
    the least scatter.
    """
    comparing, telling = work.parts(9.0, 1.0)
    contest = contest_of(rig, sensors, actuators, n_sensors, n_actuators, plan, criterion)
    n_layouts = comb(len(sensors) - len(sensors.fixed), n_sensors - len(sensors.fixed)) * comb(
        len(actuators) - len(actuators.fixed), n_actuators - len(actuators.fixed)
    )
    layouts = possible_layouts(contest) if n_layouts <= LOOKED_AT else []
    most = WORK / len(contest.units) ** 3 if limit is None else limit
    proven = n_layouts <= LOOKED_AT and len(layouts) <= most
    if proven:
        if not layouts:
            raise LabError(impossible(contest))
        figures = np.array(list(comparing.each(figures_of(contest, layouts), len(layouts))))
        order = np.argsort(figures, kind="stable")
        best = layouts[order[0]]
    else:
        figures, order = np.zeros(0), np.zeros(0, dtype=int)
        best = searched(contest, comparing)
    telling.done(0.0)
    ranking = [_ranked("best", contest, best, figures)]
    ranking += [
        _ranked(f"rank {k + 1}", contest, layouts[order[k]], figures) for k in range(1, min(TOLD, len(order)))
    ]
    if planned is not None:
        ranking.append(_ranked("planned", contest, planned, figures))
    finite = figures[np.isfinite(figures)]
    if finite.size > 1:
        ranking.append(_ranked("worst", contest, layouts[order[finite.size - 1]], figures))
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
        ranking[0].figure if proven else floor(contest),
        n_layouts,
        len(layouts) if n_layouts <= LOOKED_AT else n_layouts,
        np.sort(finite),
        tuple(ranking),
        drives=tuple(_drives(contest, best, telling)),
        warnings=tuple(_warnings(contest, n_layouts, proven)),
    )


def floor(contest: Contest) -> float | None:
    """A figure that no layout goes below: that of all sensors together, under the actuators that suit them best.

    A further sensor can only add information. None where there are too many sets of actuators.
    """
    actuators = contest.actuators
    if count(len(actuators), contest.n_actuators, n_fixed=len(actuators.fixed)) > MAX_SETS:
        return None
    sets = subsets(len(actuators), contest.n_actuators, actuators.fixed)
    return min(figure(contest.by_sensor(acting).sum(axis=0), contest.criterion) for acting in sets)


def _ranked(name: str, contest: Contest, layout: Layout, figures: Array) -> Ranked:
    sensors, actuators = layout
    possible = contest.possible(layout)
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


def _drives(contest: Contest, best: Layout, work: Work) -> Iterator[Drive]:
    """The best layout under other signals of the same largest force, with the noise that it has in the planned test."""
    rig, plan = contest.rig, contest.plan
    inputs, outputs = contest.actuators.channels_of(best[1]), contest.sensors.channels_of(best[0])
    std = plan.noise_std(rig.outputs, contest.known.rms(inputs))[:, outputs]
    # An output that a record does not move says nothing of the noise.
    felt = np.isfinite(std)
    usual = np.sum(np.where(felt, std, 0.0), axis=0) / np.maximum(np.sum(felt, axis=0), 1)
    outputs = [i for i, noise in zip(outputs, usual, strict=True) if noise > 0]
    known = rig.connected(
        inputs=[rig.inputs[i].name for i in inputs], outputs=[rig.outputs[i].name for i in outputs]
    )
    structure, unknown = rig.second_order(), free_matrices(rig.dofs)
    for kind, other in work.each(list(alternatives(rig, plan, structure.modes().frequency_hz, inputs))):
        signals = [(name, u[inputs]) for name, u in other.signals(rig, inputs)]
        test = planned_test(
            [u for _, u in signals], known.inputs, known.outputs, sample_rate=other.sample_rate
        )
        each = fisher_information(structure, test, noise_std=usual[usual > 0], parameterization=unknown)
        value = figure(each * contest.units * contest.units[:, None], contest.criterion)
        yield Drive(kind, total_duration(signals, other.sample_rate), peak(signals), value)


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
