"""Target "diagnosis": the layout with which the causes of the catalogue are hardest to mistake for one another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.errors import LabError
from lab.placement.arena import OFF, Arena, arena_of
from lab.placement.candidates import Candidates, require_number
from lab.placement.contest import Layout
from lab.placement.diagnosis_search import LIMIT, MAX_SETS, Compared, groups
from lab.placement.outcome import CauseFigure, Drive, Placement, Ranked
from lab.placement.plan import Plan, alternatives, peak, total_duration
from lab.placement.search import count
from lab.rig import Rig

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
    work: Work = UNHEARD,
) -> Placement:
    """The sensors and actuators with which causes are hardest to mistake for one another.

    Args:
        rig: with every candidate channel connected.
        sensors, actuators: candidates.
        n_sensors, n_actuators: how many to choose.
        plan: the test.
        size: of the effects: RMS change of the outputs, as a share of their RMS, over all candidates, when all
            actuators act with as much force together as those chosen will.
        causes: names of the causes to tell apart; the whole catalogue when empty.
        planned: sensors and actuators of a layout to be ranked too.
        limit: number of layouts of sensors up to which all are compared, for each set of actuators.
        work: told of every set of actuators.

    Raises:
        LabError: impossible numbers, or more effects than fit into memory.
    """
    require_number("sensor", n_sensors, sensors)
    require_number("actuator", n_actuators, actuators)
    if not (np.isfinite(size) and size > 0):
        raise LabError(f"size is {size}; expected a positive share of the response, such as 0.01")
    # Actuators that cannot be chosen rest in every test; in the same order, so that positions stay.
    rig = rig.connected(
        inputs=[rig.inputs[i].name for i in sorted(actuators.channels_of(range(len(actuators))))]
    )
    actuators = replace(actuators, channels=tuple((i,) for i in range(len(actuators))))
    gathering, comparing, telling = work.parts(
        1.0, min(count(len(actuators), n_actuators, n_fixed=len(actuators.fixed)), MAX_SETS), 5.0
    )
    gathering.done(0.0)
    everything = arena_of(rig, plan, size, causes, n_acting=n_actuators)
    compared = Compared(rig, plan, everything, sensors, actuators, n_sensors, n_actuators, limit)
    comparing.done(0.0)
    compared.search(comparing)
    ranked, driven = telling.parts(1.0, 3.0)
    ranked.done(0.0)
    chosen, acting = compared.best
    values = np.sort(np.array(list(compared.figures.values()))) if compared.proven else np.zeros(0)
    layouts = [("best", compared.best, compared.arena)]
    if planned is not None:
        own = everything.under(rig, plan, actuators.channels_of(planned[1]))
        layouts.append(("planned", (tuple(planned[0]), tuple(planned[1])), own))
    if values.size > 1:
        last = max(compared.figures, key=lambda layout: compared.figures[layout])
        layouts.append(("worst", last, everything.under(rig, plan, actuators.channels_of(last[1]))))
    layouts.append(("all sensors", (tuple(range(len(sensors))), acting), compared.arena))
    ranking = [_ranked(name, layout, arena, sensors, actuators, values) for name, layout, arena in layouts]
    driven.done(0.0)
    channels = sensors.channels_of(chosen)
    return Placement(
        "diagnosis",
        rig.name,
        "confusion",
        MEASURE,
        sensors.named(chosen),
        actuators.named(acting),
        ranking[0].figure,
        compared.proven,
        ranking[0].figure if compared.proven else None,
        compared.n_layouts,
        compared.n_layouts,
        values,
        tuple(ranking),
        drives=tuple(_drives(compared, channels, driven)),
        causes=tuple(_told(compared.arena, channels)),
        inseparable=tuple(_named(everything, group) for group in groups(compared.inseparable())),
        warnings=tuple(_warnings(compared, size)),
    )


def _ranked(
    name: str, layout: Layout, arena: Arena, sensors: Candidates, actuators: Candidates, values: Array
) -> Ranked:
    """A layout with its figure, and the mean probability of naming any wrong cause."""
    channels = sensors.channels_of(layout[0])
    value = arena.figure(channels)
    there = values.size and name != "all sensors"
    rank = int(np.sum(values < value * (1 - 1e-9))) + 1 if there else None
    details = {"any": float(np.nanmean(arena.mistakes(channels)))}
    return Ranked(name, sensors.named(layout[0]), actuators.named(layout[1]), value, rank, details)


def _told(arena: Arena, channels: Sequence[int]) -> Iterator[CauseFigure]:
    """Every cause with its likeliest confusion, worst first."""
    visible, confused, rival = arena.confusions(channels)
    wrong = arena.mistakes(channels)
    for k in np.argsort(-np.nan_to_num(confused, nan=-1.0), kind="stable"):
        if np.isfinite(confused[k]):
            taken = " at ".join(arena.keys[rival[k]]) if rival[k] >= 0 else ""
            cause, location = arena.keys[k]
            yield CauseFigure(cause, location, float(visible[k]), taken, float(confused[k]), float(wrong[k]))


def _named(arena: Arena, group: Sequence[int]) -> tuple[str, ...]:
    return tuple(" at ".join(arena.keys[i]) for i in group)


def _drives(compared: Compared, channels: Sequence[int], work: Work) -> Iterator[Drive]:
    """Other signals, and other levels of the planned one; causes of the same physical size, noise as planned."""
    rig, plan, acting = compared.rig, compared.plan, compared.actuators.channels_of(compared.best[1])
    others = list(alternatives(rig, plan, rig.second_order().modes().frequency_hz, acting))
    for name, other in work.each(others):
        signals = other.signals(rig, acting)
        value = compared.arena.driven(rig, other, acting, compared.arena.noise_std).figure(channels)
        yield Drive(name, total_duration(signals, other.sample_rate), peak(signals), value)


def _warnings(compared: Compared, size: float) -> Iterator[str]:
    plan = compared.plan
    yield (
        f"a cause is taken to change the outputs by {100 * size:g} % of their RMS over all candidates, and the noise is "
        + (f"{plan.noise_percent:g} % of the RMS of each output" if not plan.noise else "as given")
        + f"; masses, stiffnesses and dampings are {OFF:g} tolerances off; other sizes and noises may favour other places"
    )
    if len(compared.tried) < compared.n_sets:
        yield (
            f"of {compared.n_sets} sets of actuators {len(compared.tried)} were compared, those that drive the faintest mode "
            "most first, then others by exchange; fix or forbid actuators to compare all"
        )
    if len(compared.figures) < len(compared.tried) * count(
        len(compared.sensors), compared.n_sensors, n_fixed=len(compared.sensors.fixed)
    ):
        yield "the sensors found are not proven the best: they were taken away one by one, then exchanged"
    if not compared.rig.linear:
        yield "the model is not linear: effects are those about its planned motion"
