"""A connection that the model leaves out."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import mujoco
import numpy as np

from lab.effects.edits import body_element, body_number, fixed_tendon, numbers, with_tendon
from lab.effects.effect import Effect, pairs
from lab.effects.survey import Guess, Survey
from lab.errors import LabError
from lab.mjcf import number
from lab.plant import Plant
from lab.ports import name_of
from lab.rig import Rig

WORLD = "world"


@dataclass(frozen=True)
class MissingSpring(Effect):
    """Two bodies, or a body and the ground, are tied by a spring that the model does not have.

    Between bodies that slide along one line the spring acts along that line; otherwise it joins their origins.

    Attributes:
        stiffness: [N/m].
        damping: [N s/m].
    """

    cause: ClassVar[str] = "missing_spring"
    units: ClassVar[dict[str, str]] = {"stiffness": "N/m", "damping": "N s/m"}
    passive: ClassVar[tuple[str, ...]] = ("stiffness",)
    stiffness: float
    damping: float = 0.0

    def hide(self, rig: Rig) -> Rig:
        a, _, b = self.location.partition("|")
        for name in (a, b):
            self.require(name, (WORLD, *rig.bodies), "body")
        turns = _straight(rig, a, b)
        rig, tendon = _spatial(rig, a, b) if turns is None else (rig, _fixed(rig, turns))
        tendon.set("name", f"spring@{a}|{b}")
        tendon.set("stiffness", number(self.stiffness))
        tendon.set("damping", number(self.damping))
        return with_tendon(rig, tendon)

    def explain(self, plant: Plant, survey: Survey) -> Plant:
        row = self._row(survey.rig)
        return replace(
            plant,
            stiffness=plant.stiffness + self.stiffness * np.outer(row, row),
            damping=plant.damping + self.damping * np.outer(row, row),
        )

    @classmethod
    def guesses(cls, survey: Survey, location: str) -> list[Guess]:
        row = cls(location, 1.0)._row(survey.rig)
        stiff = survey.push(row) / survey.travel(row)
        return [Guess({"stiffness": 0.0}, {"stiffness": stiff})]

    def _row(self, rig: Rig) -> np.ndarray:
        """Extension of the new spring per displacement."""
        a, _, b = self.location.partition("|")
        for name in (a, b):
            self.require(name, (WORLD, *rig.bodies), "body")
        return _row_of(rig, a, b)

    @classmethod
    def places(cls, rig: Rig) -> tuple[str, ...]:
        """Every pair of bodies, and every body and the ground, not tied by a spring yet and moving against each other."""
        tied, motion = _tied(rig), _motion(rig)
        return tuple(
            pair
            for pair in pairs((WORLD, *rig.bodies))
            if pair not in tied and _possible(rig, pair) and _extends(rig, pair, motion)
        )


@lru_cache(maxsize=4096)
def _row_of(rig: Rig, a: str, b: str) -> np.ndarray:
    turns = _straight(rig, a, b)
    if turns is not None:
        return np.array([turns.get(name, 0.0) for name in rig.dofs])
    length, rate = _line(rig, a, b)
    return rate / length


def _lone_slide(rig: Rig, body: str) -> tuple[str, np.ndarray] | None:
    """Name and world axis of the only joint between a body and the ground, if that is a slide."""
    m = rig.model
    index = body_number(rig, body)
    if m.body_jntnum[index] != 1 or m.body_weldid[m.body_parentid[index]] != 0:
        return None
    joint = m.body_jntadr[index]
    # A fixed tendon can only join joints that have names.
    if m.jnt_type[joint] != int(mujoco.mjtJoint.mjJNT_SLIDE) or not m.joint(joint).name:
        return None
    data = mujoco.MjData(m)
    data.qpos[:] = rig.operating_point
    mujoco.mj_kinematics(m, data)
    return rig.dofs[joint], data.xaxis[joint].copy()


def _straight(rig: Rig, a: str, b: str) -> dict[str, float] | None:
    """Extension per displacement of the joints, between bodies that slide along one direction."""
    slides = [(1.0 if body == b else -1.0, _lone_slide(rig, body)) for body in (a, b) if body != WORLD]
    if any(slide is None or not slide[0] for _, slide in slides):
        return None
    axes = [slide[1] for _, slide in slides if slide is not None]
    along = float(axes[0] @ axes[-1])
    if abs(abs(along) - 1) > 1e-9:
        return None
    signs = [1.0, 1.0] if along > 0 else [1.0, -1.0]
    return {
        slide[0]: sign * turn for (sign, slide), turn in zip(slides, signs, strict=False) if slide is not None
    }


def _fixed(rig: Rig, turns: dict[str, float]) -> ET.Element:
    """A fixed tendon over joints, at rest where they rest."""
    tendon = fixed_tendon("", turns)
    at_rest = sum(c * rig.operating_point[rig.dofs.index(joint)] for joint, c in turns.items())
    tendon.set("springlength", number(at_rest))
    return tendon


def _spatial(rig: Rig, a: str, b: str) -> tuple[Rig, ET.Element]:
    """A spatial tendon between the origins of two bodies, at rest where they rest."""
    length, _ = _line(rig, a, b)

    def edit(root: ET.Element) -> None:
        for body in (a, b):
            element, name = body_element(root, body), f"origin@{body}"
            if element.find(f"site[@name='{name}']") is None:
                ET.SubElement(element, "site", name=name, pos=numbers([0.0, 0.0, 0.0]))

    tendon = ET.Element("spatial", springlength=number(length))
    for body in (a, b):
        ET.SubElement(tendon, "site", site=f"origin@{body}")
    return rig.edited(edit), tendon


def _line(rig: Rig, a: str, b: str) -> tuple[float, np.ndarray]:
    """Length of the line between the origins of two bodies, and its rate per displacement times that length."""
    if WORLD in (a, b):
        raise LabError(
            f"missing_spring at '{a}|{b}': the body can move in several directions, so a spring to the ground has none; name "
            "two bodies"
        )
    (here, J), (there, other) = (_motion(rig)[body] for body in (a, b))
    along = there - here
    length = float(np.linalg.norm(along))
    if length == 0:
        raise LabError(
            f"missing_spring at '{a}|{b}': the bodies share their origin, so the spring has no direction"
        )
    return length, along @ (other - J)


def _possible(rig: Rig, pair: str) -> bool:
    a, _, b = pair.partition("|")
    return WORLD not in (a, b) or _lone_slide(rig, b) is not None


@lru_cache(maxsize=16)
def _motion(rig: Rig) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Place of the origin of every body that can move, and its motion per displacement, (3,) and (3, n_dofs)."""
    m, data = rig.model, mujoco.MjData(rig.model)
    data.qpos[:] = rig.operating_point
    mujoco.mj_kinematics(m, data)
    mujoco.mj_comPos(m, data)
    found = {}
    for body in rig.bodies:
        index, J = body_number(rig, body), np.zeros((3, m.nv))
        mujoco.mj_jac(m, data, J, None, data.xpos[index], index)
        found[body] = (data.xpos[index].copy(), J)
    return found


def _extends(rig: Rig, pair: str, motion: dict[str, tuple[np.ndarray, np.ndarray]]) -> bool:
    """Whether a spring between two bodies extends with small displacements: one along a straight beam does not."""
    a, _, b = pair.partition("|")
    if WORLD in (a, b) or _straight(rig, a, b) is not None:
        return True
    (here, J), (there, other) = motion[a], motion[b]
    along = there - here
    rate = along @ (other - J)
    return bool(np.any(np.abs(rate) > 1e-9 * np.linalg.norm(along) * (np.abs(J) + np.abs(other)).max()))


def _tied(rig: Rig) -> set[str]:
    """Pairs of bodies that a spring ties already."""
    m = rig.model
    order = [WORLD, *rig.bodies]
    found = set()
    for spring in rig.springs:
        if spring.kind == "joint":
            body = m.jnt_bodyid[spring.index]
            ends = [m.body_parentid[body], body]
        else:
            first = m.tendon_adr[spring.index]
            wraps = range(first, first + m.tendon_num[spring.index])
            fixed = m.wrap_type[first] == int(mujoco.mjtWrap.mjWRAP_JOINT)
            ends = [m.jnt_bodyid[m.wrap_objid[w]] if fixed else m.site_bodyid[m.wrap_objid[w]] for w in wraps]
            if fixed and len(set(ends)) == 1:
                ends.append(0)
        names = {WORLD if m.body_weldid[body] == 0 else name_of(m, "body", body) for body in ends}
        if len(names) == 2:
            found.add("|".join(sorted(names, key=order.index)))
    return found
