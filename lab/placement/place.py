"""Place: candidates, plan and target in, a placement out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from identification.progress import Progress, Work
from lab.errors import LabError
from lab.placement.candidates import (
    Candidates,
    actuator_candidates,
    require_known,
    require_number,
    sensor_candidates,
)
from lab.placement.outcome import Placement
from lab.placement.plan import Plan, usual_plan
from lab.rig import Rig

TARGETS = ("modes", "matrices", "diagnosis")


def place(
    rig: Rig,
    n_sensors: int,
    *,
    n_actuators: int = 0,
    target: str = "modes",
    fixed: Sequence[str] = (),
    forbid: Sequence[str] = (),
    quantity: str | None = None,
    triaxial: bool = False,
    plan: Plan | None = None,
    noise: Mapping[str, float] | None = None,
    planned: tuple[Sequence[str], Sequence[str]] | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> Placement:
    """Where sensors and actuators should go, and what each choice costs.

    Args:
        rig: its connected actuators and sensors are the candidates.
        n_sensors: how many sensors; channels unless `triaxial`.
        n_actuators: how many actuators; none are placed when 0, which only the target "modes" allows.
        target: "modes" (mode shapes told apart), "matrices" (least scatter of M, C and K) or "diagnosis" (causes told apart).
        fixed: sensors, channels or actuators that must be chosen.
        forbid: those that must not, with * and ? as wildcards.
        quantity: of the sensors: "acceleration", "velocity" or "displacement"; any when None.
        triaxial: the axes of a sensor are chosen together.
        plan: the test that is planned; a random one that suits the structure when None.
        noise: standard deviation by unit, such as {"m/s^2": 0.01}; as the plan says when None.
        planned: names of the sensors and actuators of a layout to be ranked too.
        progress: told what is being done, and the share of it that is done.
        settings: of the target: see `place_modes`, `place_matrices`, `place_diagnosis`.

    Returns:
        The placement.

    Raises:
        LabError: names, numbers or settings that do not fit the rig or one another.
    """
    if target not in TARGETS:
        raise LabError(f"target is {target!r}; expected {', '.join(TARGETS)}")
    work = Work(progress).called("placing")
    require_known(rig, fixed, forbid)
    sensors = sensor_candidates(rig, quantity=quantity, triaxial=triaxial, fixed=fixed, forbid=forbid)
    actuators = actuator_candidates(rig, fixed=fixed, forbid=forbid)
    other = None if planned is None else (_found(sensors, planned[0]), _found(actuators, planned[1]))
    if target == "modes":
        from lab.placement.modes import place_modes

        return place_modes(
            rig,
            sensors,
            actuators,
            n_sensors,
            n_actuators,
            noise=noise,
            plan=plan,
            planned=other,
            work=work,
            **settings,
        )
    # What cannot be chosen costs no work; in the same order, so that positions among the candidates stay.
    outputs = [rig.outputs[i].name for i in sorted(sensors.channels_of(range(len(sensors))))]
    if len(outputs) < len(rig.outputs):
        rig = rig.connected(outputs=outputs)
        sensors = sensor_candidates(rig, quantity=quantity, triaxial=triaxial, fixed=fixed, forbid=forbid)
    if not n_actuators:
        raise LabError(f"no number of actuators is given; expected one for the target {target}")
    require_number("actuator", n_actuators, actuators)
    if plan is None:
        plan = usual_plan(rig.second_order().modes().frequency_hz)
    if noise:
        plan = replace(plan, noise=noise)
    if target == "matrices":
        from lab.placement.matrices import place_matrices

        return place_matrices(
            rig, sensors, actuators, n_sensors, n_actuators, plan, planned=other, work=work, **settings
        )
    from lab.placement.diagnosis import place_diagnosis

    return place_diagnosis(
        rig, sensors, actuators, n_sensors, n_actuators, plan, planned=other, work=work, **settings
    )


def _found(candidates: Candidates, names: Sequence[str]) -> tuple[int, ...]:
    """Positions of candidates by their names, rising."""
    for name in names:
        if name not in candidates.names:
            raise LabError(
                f"the planned layout has {name!r}, which is no candidate; allow it, or plan without a layout of its own"
            )
    return tuple(sorted(candidates.names.index(name) for name in names))
