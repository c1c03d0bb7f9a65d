"""Edits of MJCF that effects share: springs, masses, extra tendons; every number is written to its last digit."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence

import numpy as np

from lab.errors import RigError
from lab.mjcf import free_name, number
from lab.rig import Rig, Spring
from lab.twin import movable

Edit = Callable[[ET.Element], None]


def law_of(rig: Rig, spring: Spring) -> tuple[list[float], list[float]]:
    """Coefficients of a spring: k, k2, k3 of k x + k2 x² + k3 x³, and c, c2, c3 of c v + c2 |v| v + c3 v³."""
    m, i = rig.model, spring.index
    if spring.kind == "joint":
        dof = m.jnt_dofadr[i]
        stiffness = [m.jnt_stiffness[i], *m.jnt_stiffnesspoly[i]]
        damping = [m.dof_damping[dof], *m.dof_dampingpoly[dof]]
    else:
        stiffness = [m.tendon_stiffness[i], *m.tendon_stiffnesspoly[i]]
        damping = [m.tendon_damping[i], *m.tendon_dampingpoly[i]]
    return [float(x) for x in stiffness], [float(x) for x in damping]


def with_law(
    rig: Rig, name: str, *, stiffness: Sequence[float] | None = None, damping: Sequence[float] | None = None
) -> Rig:
    """The rig with other coefficients in one spring."""
    spring = rig.spring(name)

    def edit(root: ET.Element) -> None:
        element = spring_element(root, spring)
        for key, values in (("stiffness", stiffness), ("damping", damping)):
            if values is not None:
                element.set(key, numbers(values))

    return rig.edited(edit)


def body_number(rig: Rig, name: str) -> int:
    """Number of a body that can move; one without a name in the MJCF is called after it."""
    return movable(rig.model)[rig.bodies.index(name)]


def with_mass(rig: Rig, name: str, factor: float) -> Rig:
    """The rig with the mass of one body, and its inertia with it, multiplied by a factor."""
    m, body = rig.model, body_number(rig, name)

    def edit(root: ET.Element) -> None:
        element = body_element(root, name)
        for inertial in element.findall("inertial"):
            element.remove(inertial)
        inertial = ET.Element("inertial")
        inertial.set("pos", numbers(m.body_ipos[body]))
        inertial.set("quat", numbers(m.body_iquat[body]))
        inertial.set("mass", number(factor * m.body_mass[body]))
        inertial.set("diaginertia", numbers(factor * m.body_inertia[body]))
        element.insert(0, inertial)

    return rig.edited(edit)


def with_tendon(rig: Rig, tendon: ET.Element) -> Rig:
    """The rig with one more tendon."""

    def edit(root: ET.Element) -> None:
        tendon.set("name", free_name(root, tendon.get("name", "")))
        section(root, "tendon").append(tendon)

    return rig.edited(edit)


def copy_of(rig: Rig, spring: Spring, name: str) -> ET.Element:
    """A tendon without a law of its own that has the extension of `spring`, and its length at rest as `springlength`."""
    root = ET.fromstring(rig.xml)
    if spring.kind == "joint":
        tendon = fixed_tendon(name, {spring.name: 1.0})
    else:
        source = spring_element(root, spring)
        tendon = ET.Element(source.tag, name=name)
        tendon.extend(list(source))
    for key in ("stiffness", "damping", "frictionloss", "armature"):
        tendon.set(key, "0")
    tendon.set("springlength", number(spring.reference))
    return tendon


def fixed_tendon(name: str, coefficients: dict[str, float]) -> ET.Element:
    """A fixed tendon whose length is a combination of joint positions."""
    tendon = ET.Element("fixed", name=name)
    for joint, coefficient in coefficients.items():
        ET.SubElement(tendon, "joint", joint=joint, coef=number(coefficient))
    return tendon


def section(root: ET.Element, tag: str) -> ET.Element:
    """The last section of that tag, made where there is none."""
    found = root.findall(tag)
    return found[-1] if found else ET.SubElement(root, tag)


def spring_element(root: ET.Element, spring: Spring) -> ET.Element:
    """The MJCF element of a spring."""
    tags = ("joint",) if spring.kind == "joint" else ("fixed", "spatial")
    place = "worldbody" if spring.kind == "joint" else "tendon"
    return _named(root, place, tags, spring.name)


def body_element(root: ET.Element, name: str) -> ET.Element:
    """The MJCF element of a body."""
    return _named(root, "worldbody", ("body",), name)


def joint_element(root: ET.Element, name: str) -> ET.Element:
    """The MJCF element of a joint."""
    return _named(root, "worldbody", ("joint",), name)


def numbers(values: Sequence[float] | np.ndarray) -> str:
    """Numbers as an MJCF attribute."""
    return " ".join(number(value) for value in values)


def _named(root: ET.Element, place: str, tags: Sequence[str], name: str) -> ET.Element:
    found = [element for part in root.findall(place) for element in part.iter() if element.tag in tags]
    # The world is body 0, and joints count from 0.
    first = 1 if tags == ("body",) else 0
    for number_, element in enumerate(found, start=first):
        if name in (element.get("name"), f"{tags[0]}{number_}" if element.get("name") is None else None):
            return element
    raise RigError(
        f"<{tags[0]} name={name!r}> stands nowhere in the MJCF as written (a replicated or attached element cannot be "
        "edited); write it out"
    )
