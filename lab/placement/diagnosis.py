"""Target "diagnosis": the sensors with which the causes of the catalogue are hardest to mistake for one another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from identification.recording import Array
from lab.errors import LabError
from lab.placement.arena import OFF, Arena, arena_of, products_of
from lab.placement.candidates import Candidates, require_number
from lab.placement.outcome import CauseFigure, Drive, Placement, Ranked
from lab.placement.plan import Plan, alternatives, driving_level, peak, total_duration
from lab.placement.search import count
from lab.placement.shapes import choose_actuators
from lab.placement.suspects import suspects
from lab.rig import Rig

LIMIT = 200
"""Layouts up to this number are all compared, which proves the best."""
LEVELS = (0.1, 1.0, 10.0)
"""Forces compared, as shares of the planned ones."""
MEASURE = "mean over all causes of the probability of naming the likeliest wrong one"


def place_diagnosis(
    rig: Rig,
    sensors: Candidates,
    actuators: Candidates,
    n_sensors: int,
    n_actuators: int,
    plan: Plan,
    *,
    size: float = 0.01,
    causes: Sequence[str] = (),
    planned: tuple[Sequence[int], Sequence[int]] | None = None,
    limit: int = LIMIT,
) -> Placement:
    """The sensors with which causes are hardest to mistake for one another.

    Args:
        rig: with every candidate channel connected.
        sensors, actuators: candidates.
        n_sensors, n_actuators: how many to choose; the actuators are those that drive all modes best.
        plan: the test.
        size: of the effects: RMS change of the outputs, as a share of their RMS, over all candidates.
        causes: names of the causes to tell apart; the whole catalogue when empty.
        planned: sensors and actuators of a layout to be ranked too, with its own actuators.
        limit: number of layouts up to which all are compared.

    Raises:
        LabError: impossible numbers, or more effects than fit into memory.
    """
    require_number("sensor", n_sensors, sensors)
    if not (np.isfinite(size) and size > 0):
        raise LabError(f"size is {size}; expected a positive share of the response, such as 0.01")
    inputs = choose_actuators(rig, actuators, n_actuators)
    driven = rig.connected(inputs=[rig.inputs[i].name for i in actuators.channels_of(inputs)])
    arena, std = arena_of(driven, plan, size, causes)
    n_layouts = count(len(sensors), n_sensors, n_fixed=len(sensors.fixed))
    proven = n_layouts <= limit
    chosen, figures = (
        _all(arena, sensors, n_sensors) if proven else (_searched(arena, sensors, n_sensors), {})
    )
    named = actuators.named(inputs)
    best = arena.figure(sensors.channels_of(chosen))
    values = np.sort(np.array(list(figures.values())))
    ranking = [Ranked("best", sensors.named(chosen), named, best, 1 if proven else None, {})]
    if planned is not None:
        same = tuple(planned[1]) == tuple(inputs)
        other = arena
        if not same:
            names = [rig.inputs[i].name for i in actuators.channels_of(planned[1])]
            other = arena_of(rig.connected(inputs=names), plan, size, causes)[0]
        value = other.figure(sensors.channels_of(planned[0]))
        rank = int(np.sum(values < value * (1 - 1e-9))) + 1 if same and proven else None
        ranking.append(
            Ranked("planned", sensors.named(planned[0]), actuators.named(planned[1]), value, rank, {})
        )
    if len(figures) > 1:
        last = max(figures, key=lambda choice: figures[choice])
        ranking.append(Ranked("worst", sensors.named(last), named, figures[last], len(figures), {}))
    everything = arena.figure(sensors.channels_of(range(len(sensors))))
    ranking.append(Ranked("all candidates", sensors.names, named, everything, None, {}))
    return Placement(
        "diagnosis",
        rig.name,
        "confusion",
        MEASURE,
        sensors.named(chosen),
        named,
        best,
        proven,
        best if proven else None,
        n_layouts,
        n_layouts,
        values,
        tuple(ranking),
        drives=tuple(_drives(driven, plan, arena, std, sensors.channels_of(chosen))),
        causes=tuple(_told(arena, sensors.channels_of(chosen))),
        inseparable=tuple(_groups(arena)),
        warnings=tuple(_warnings(rig, plan, actuators, n_actuators, size, proven)),
    )


def _all(arena: Arena, sensors: Candidates, n: int) -> tuple[tuple[int, ...], dict[tuple[int, ...], float]]:
    """The best of all layouts, and the figure of each."""
    free = [i for i in range(len(sensors)) if i not in sensors.fixed]
    figures = {}
    for rest in combinations(free, n - len(sensors.fixed)):
        choice = tuple(sorted((*sensors.fixed, *rest)))
        figures[choice] = arena.figure(sensors.channels_of(choice))
    return min(figures, key=lambda choice: figures[choice]), figures


def _searched(arena: Arena, sensors: Candidates, n: int) -> tuple[int, ...]:
    """Sensors left when those that help least are taken away one by one, then exchanged while that helps."""
    chosen = list(range(len(sensors)))

    def value(choice: Sequence[int]) -> float:
        return arena.figure(sensors.channels_of(choice))

    while len(chosen) > n:
        loose = [i for i in chosen if i not in sensors.fixed]
        least = min(loose, key=lambda i: value([j for j in chosen if j != i]))
        chosen.remove(least)
    best, improved = value(chosen), True
    while improved:
        improved = False
        for old in [i for i in chosen if i not in sensors.fixed]:
            rest = [i for i in range(len(sensors)) if i not in chosen]
            trials = {new: value(sorted({*chosen, new} - {old})) for new in rest}
            new = min(trials, key=lambda i: trials[i]) if trials else old
            if trials and trials[new] < best * (1 - 1e-9):
                chosen, best, improved = sorted({*chosen, new} - {old}), trials[new], True
    return tuple(chosen)


def _told(arena: Arena, channels: Sequence[int]) -> Iterator[CauseFigure]:
    """Every cause with its likeliest confusion, worst first."""
    visible, confused, rival = arena.confusions(channels)
    for k in np.argsort(-np.nan_to_num(confused, nan=-1.0), kind="stable"):
        if np.isfinite(confused[k]):
            taken = " at ".join(arena.keys[rival[k]]) if rival[k] >= 0 else ""
            cause, location = arena.keys[k]
            yield CauseFigure(cause, location, float(visible[k]), taken, float(confused[k]))


def _groups(arena: Arena) -> Iterator[tuple[str, ...]]:
    """Causes that are alike in all outputs of all candidates, two or more at a time."""
    seen: set[int] = set()
    for k, row in enumerate(arena.alike):
        members = [int(i) for i in np.flatnonzero(row)]
        if len(members) > 1 and k not in seen:
            seen |= set(members)
            yield tuple(" at ".join(arena.keys[i]) for i in members)


def _drives(rig: Rig, plan: Plan, arena: Arena, std: Array, channels: Sequence[int]) -> Iterator[Drive]:
    """Other signals, and other levels of the planned one; causes of the same physical size, noise as planned."""

    def drive(name: str, other: Plan) -> Drive:
        found = suspects(rig, other, like=arena.suspects)
        products = products_of(found, std, arena.sizes)
        value = replace(arena, suspects=found, products=products).figure(channels)
        signals = other.signals(rig)
        return Drive(name, total_duration(signals, other.sample_rate), peak(signals), value)

    for kind, other in alternatives(rig, plan, rig.second_order().modes().frequency_hz):
        yield drive(kind, other)
    for level in LEVELS:
        other = plan.driven(driving_level(plan.excitation, level))
        yield drive(f"{plan.excitation.kind} as planned, times {level:g}", other)


def _warnings(
    rig: Rig, plan: Plan, actuators: Candidates, n_actuators: int, size: float, proven: bool
) -> Iterator[str]:
    yield (
        f"a cause is taken to change the outputs by {100 * size:g} % of their RMS over all candidates, and the noise is "
        + (f"{plan.noise_percent:g} % of the RMS of each output" if not plan.noise else "as given")
        + f"; masses, stiffnesses and dampings are {OFF:g} tolerances off; other sizes and noises may favour other places"
    )
    if n_actuators < len(actuators):
        yield "the actuators are those that drive the faintest mode most, whatever the causes"
    if not proven:
        yield "the best layout found is not proven: sensors were taken away one by one, then exchanged"
    if not rig.linear:
        yield "the model is not linear: effects are those about its planned motion"
