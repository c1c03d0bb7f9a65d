"""Target "modes": sensors that tell the mode shapes apart, actuators that drive every mode."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.errors import LabError
from lab.placement.candidates import Candidates, motion_rows, require_number
from lab.placement.choice import LIMIT, Choice, choose
from lab.placement.criteria import CRITERIA, Criterion
from lab.placement.independence import effective_independence, kinetic_energy
from lab.placement.loading import added_mass, frequency_shifts
from lab.placement.modal_drives import MEASURE, modal_drives
from lab.placement.outcome import Drive, Placement, Ranked
from lab.placement.plan import Plan, usual_plan
from lab.placement.roving import arranged
from lab.placement.search import count, greedy
from lab.placement.shapes import choose_actuators, normal_modes, sensor_shapes
from lab.rig import Rig

COSTS = 2.0, 1.0, 1.0, 4.0
"""Of choosing sensors and actuators, ranking by other rules, and comparing signals, as measured."""
SAME = 1e-9
"""Figures that differ by less, relatively, are the same."""


def place_modes(
    rig: Rig,
    sensors: Candidates,
    actuators: Candidates,
    n_sensors: int,
    n_actuators: int,
    *,
    criterion: str = "d",
    n_modes: int | None = None,
    noise: Mapping[str, float] | None = None,
    plan: Plan | None = None,
    setups: int = 1,
    references: int = 0,
    sensor_mass: float = 0.0,
    planned: tuple[Sequence[int], Sequence[int]] | None = None,
    limit: int = LIMIT,
    work: Work = UNHEARD,
) -> Placement:
    """The sensors that tell the modes apart best, and the actuators that drive all of them.

    Args:
        rig: with every candidate channel connected.
        sensors, actuators: candidates.
        n_sensors, n_actuators: how many to choose; with roving sensors, those of one set-up.
        criterion: "d", "a" or "e" for the information about modal coordinates, or "mac".
        n_modes: lowest modes asked for; as many as channels, or as there are, when None.
        noise: standard deviation by unit; equal for all sensors when None.
        plan: the test for which signals are compared; a random one that suits the modes when None.
        setups: set-ups between which sensors rove.
        references: sensors that stay in every set-up.
        sensor_mass: of each sensor [kg].
        planned: sensors and actuators of a layout to be ranked too.
        limit: number of layouts up to which all are compared.
        work: told how much of this is done.

    Raises:
        LabError: more modes than the sensors can tell apart, an unknown criterion, or references that do not fit.
    """
    choosing, driving, judging, signalling = work.parts(*COSTS)
    if criterion not in ("d", "a", "e", "mac"):
        raise LabError(f"criterion is {criterion!r}; expected d, a, e or mac for the target modes")
    require_number("sensor", n_sensors, sensors)
    _require_references(n_sensors, setups, references)
    total = references + setups * (n_sensors - references)
    require_number("sensor", total, sensors)
    _require_comparable(rig, sensors, noise or {})
    omega, shapes = normal_modes(rig)
    n_channels = sum(sorted(len(own) for own in sensors.channels)[::-1][:total])
    m = min(n_channels, len(omega)) if n_modes is None else n_modes
    if not 1 <= m <= min(n_channels, len(omega)):
        raise LabError(
            f"{m} modes asked for, with {n_channels} channels and {len(omega)} modes of the structure; expected 1 to "
            f"{min(n_channels, len(omega))}"
        )
    omega, shapes, rows = omega[:m], shapes[:, :m], motion_rows(rig)
    blocks = sensors.padded(sensor_shapes(rig, rows @ shapes, omega, noise or {}))
    grams = np.einsum("bcm,bcn->bmn", blocks, blocks)
    rule = CRITERIA[criterion]
    fixed = sensors.fixed
    stay: tuple[int, ...] = ()
    if setups > 1:
        stay = choose(grams, references, CRITERIA["visibility"], fixed=fixed[:references], limit=limit).chosen
        fixed = tuple(sorted({*fixed, *stay}))
    found = choose(grams, total, rule, fixed=fixed, limit=limit, work=choosing)
    if not np.isfinite(found.score) or not np.isfinite(rule.figure(np.array(found.score))):
        raise LabError(
            f"{total} sensors among these {len(sensors)} candidates cannot tell {m} modes apart; ask for fewer modes, or "
            "allow more places"
        )
    driving.done(0.0)
    inputs = choose_actuators(rig, actuators, n_actuators, n_modes=m, limit=limit)
    judging.done(0.0)
    momenta = sensors.padded(rows @ (rig.second_order().mass @ shapes))
    rules = _rules(blocks, grams, momenta, total, sensors, found.chosen, rule)
    named = actuators.named(inputs)
    ranking = [_ranked(name, grams, chosen, rule, found, sensors, named) for name, chosen in rules.items()]
    if planned is not None:
        ranking.append(
            _ranked("planned", grams, planned[0], rule, found, sensors, actuators.named(planned[1]))
        )
    if len(found.layouts) > 1:
        last = np.flatnonzero(np.isfinite(found.scores))[-1]
        ranking.append(_ranked("worst", grams, found.layouts[last], rule, found, sensors, named))
    placed = arranged(grams, found.chosen, stay, setups)
    shifts = _loading(rig, sensors, placed, shapes, sensor_mass)
    possible = found.scores[np.isfinite(found.scores)]
    signalling.done(0.0)
    n_layouts = count(len(sensors), total, n_fixed=len(fixed))
    drives = tuple(
        _drives(rig, plan, sensors.channels_of(placed[0]), actuators.channels_of(inputs), omega, noise)
    )
    return Placement(
        "modes",
        rig.name,
        criterion,
        rule.measure + (" [in noise]" if noise else ""),
        sensors.named(found.chosen),
        named,
        float(rule.figure(np.array(found.score))),
        found.proven,
        float(rule.figure(np.array(found.ceiling))),
        n_layouts,
        len(possible) if found.proven else n_layouts,
        rule.figure(possible),
        tuple(ranking),
        drives=drives,
        drive_measure=MEASURE if drives else "",
        setups=tuple(sensors.named(each) for each in placed) if setups > 1 else (),
        frequency_shifts=shifts,
        warnings=(*_warnings(placed, shifts, sensor_mass), *_unsaid(len(inputs), drives)),
    )


def _drives(
    rig: Rig,
    plan: Plan | None,
    outputs: Sequence[int],
    inputs: Sequence[int],
    omega: Array,
    noise: Mapping[str, float] | None,
) -> Iterator[Drive]:
    """Signals compared where there are actuators; with roving sensors, in the first set-up."""
    if inputs:
        plan = plan or usual_plan(omega / (2 * np.pi))
        yield from modal_drives(
            rig, replace(plan, noise=noise) if noise else plan, outputs, inputs, len(omega)
        )


def _unsaid(n_actuators: int, drives: Sequence[Drive]) -> Iterator[str]:
    if n_actuators and not drives:
        yield (
            "signals are not compared: modes, sensors and actuators have too many unknowns together; ask for fewer of them"
        )


def _require_references(n_sensors: int, setups: int, references: int) -> None:
    if setups < 1 or (setups == 1 and references):
        raise LabError(
            f"{setups} set-ups with {references} references; expected references only where there are several set-ups"
        )
    if setups > 1 and not 1 <= references < n_sensors:
        raise LabError(
            f"{references} of {n_sensors} sensors are references; expected 1 to {n_sensors - 1}, so that set-ups can be "
            "joined and some sensors rove"
        )


def _require_comparable(rig: Rig, sensors: Candidates, noise: Mapping[str, float]) -> None:
    units = sorted({rig.outputs[i].unit for own in sensors.channels for i in own})
    lacking = [unit for unit in units if unit not in noise]
    if noise and lacking:
        raise LabError(
            f"no noise is given for sensors in {', '.join(lacking)}; expected one number for each unit"
        )
    if len(lacking) > 1:
        raise LabError(
            f"the candidates read in {', '.join(units)}, which nothing makes comparable; give the noise of each, or one "
            "quantity"
        )


def _rules(
    blocks: Array,
    grams: Array,
    momenta: Array,
    n: int,
    sensors: Candidates,
    best: tuple[int, ...],
    rule: Criterion,
) -> dict[str, tuple[int, ...]]:
    """Layouts by the classical rules beside the best."""
    return {
        "best": best,
        "effective independence": effective_independence(blocks, n, fixed=sensors.fixed),
        "kinetic energy": kinetic_energy(blocks, momenta, n, fixed=sensors.fixed),
        "greedy": greedy(grams, n, rule, fixed=sensors.fixed),
    }


def _ranked(
    name: str,
    grams: Array,
    chosen: Sequence[int],
    rule: Criterion,
    found: Choice,
    sensors: Candidates,
    actuators: tuple[str, ...],
) -> Ranked:
    """A layout with its figures by every criterion."""
    G = grams[list(chosen)].sum(axis=0)[None]
    score = float(rule.score(G)[0])
    slack = SAME * max(abs(score), 1e-300) if np.isfinite(score) else 0.0
    rank = int(np.sum(found.scores > score + slack)) + 1 if len(found.scores) else None
    details = {
        each.name: float(each.figure(each.score(G))[0])
        for each in CRITERIA.values()
        if each.name != "visibility"
    }
    return Ranked(name, sensors.named(chosen), actuators, details[rule.name], rank, details)


def _loading(
    rig: Rig, sensors: Candidates, placed: list[tuple[int, ...]], shapes: Array, mass: float
) -> tuple[float, ...]:
    if not mass:
        return ()
    if not mass > 0:
        raise LabError(f"the mass of a sensor is {mass} kg; expected a positive number")
    s = rig.second_order()
    shifts = [
        frequency_shifts(
            s.mass,
            s.stiffness,
            shapes,
            added_mass(rig, [rig.outputs[i].name for i in sensors.channels_of(each)], mass),
        )
        for each in placed
    ]
    return tuple(float(x) for x in np.min(shifts, axis=0))


def _warnings(placed: list[tuple[int, ...]], shifts: Sequence[float], mass: float) -> list[str]:
    told = []
    if len(placed) > 1:
        told.append(
            "references were chosen first, as those that see the faintest mode best, and the other sensors with them"
        )
    if shifts and min(shifts) < -1e-3:
        told.append(
            f"sensors of {mass:g} kg lower the frequency of mode {int(np.argmin(shifts)) + 1} by {-100 * min(shifts):.2g} %"
            + (", and by another share in every set-up" if len(placed) > 1 else "")
            + "; use lighter ones, or put their mass into the model"
        )
    return told
