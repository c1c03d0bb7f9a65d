"""Rig: a structure in MJCF plus the measurement chain around it.

Simulating a rig gives a recording. An effect turns a rig into another rig: structural effects edit the MJCF, instrument
effects edit the chain, and the whole is saved in one MJCF file.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from identification.modes import Modes
from identification.recording import Array, Channel
from identification.systems import SecondOrder, StateSpace
from lab import linearize, mjcf, ports, tangent
from lab.chain import Chain
from lab.errors import FileError, RigError, UnknownNameError

CHAIN_TEXT = "lab:chain"
"""Name of the <custom> text that holds the measurement chain."""


@dataclass(frozen=True)
class Spring:
    """A joint or tendon with stiffness or damping.

    Attributes:
        name: of the joint or tendon.
        kind: "joint" or "tendon".
        index: its number among the joints or tendons of the compiled model.
        reference: position or length at which the spring is at rest [m or rad].
    """

    name: str
    kind: str
    index: int
    reference: float


@dataclass(frozen=True, eq=False, repr=False)
class Rig:
    """A structure plus its measurement chain.

    Attributes:
        xml: MJCF text, includes expanded.
        chain: which channels are recorded, and what actuators, sensors and acquisition do to the signals.
        folder: where relative files of the MJCF lie; None when it names none.

    Raises:
        RigError: MuJoCo refuses the MJCF, or it has joints other than slides and hinges, delays or plastic springs.
        UnknownNameError: the chain names a channel that does not exist.
    """

    xml: str
    chain: Chain
    folder: Path | None = None

    def __post_init__(self) -> None:
        model = self.model
        if model.nv == 0:
            raise RigError(
                f"model {self.name!r} has no joint, so nothing can move; expected at least one slide or hinge"
            )
        simple = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
        for index in range(model.njnt):
            if model.jnt_type[index] not in simple:
                raise RigError(
                    f"joint {ports.name_of(model, 'joint', index)!r} of model {self.name!r} is a free or ball joint; expected "
                    "slide and hinge joints (three slides and three hinges move a body freely)"
                )
        if model.nhistory:
            raise RigError(
                f"model {self.name!r} delays an actuator or sensor by itself (nsample), which substeps would distort; remove "
                "it and put a delay into the measurement chain"
            )
        if np.any(model.jnt_springyield) or np.any(model.tendon_springyield):
            raise RigError(
                f"model {self.name!r} has a plastic spring (springyield), which Runge-Kutta steps cannot follow; remove it and "
                "add the effect 'hysteresis'"
            )
        inputs, outputs = ([c.name for c in side] for side in (self._ports.inputs, self._ports.outputs))
        self.chain.check(inputs, outputs, self.dofs)

    @classmethod
    def load(cls, path: str | Path) -> Rig:
        """The rig in an MJCF file, plain or saved by the lab.

        Raises:
            FileError: the file cannot be read.
            RigError: it is no MJCF that MuJoCo compiles.
        """
        path = Path(path)
        return cls.from_xml(mjcf.read(path), path.resolve().parent)

    @classmethod
    def from_xml(cls, xml: str, folder: Path | None = None) -> Rig:
        """The rig in an MJCF text; relative files are looked up in `folder`."""
        root = mjcf.parse(xml)
        return cls(xml, _read_chain(root), folder)

    def save(self, path: str | Path) -> None:
        """Writes structure and chain into one MJCF file that plain MuJoCo loads too.

        Raises:
            FileError: the file cannot be written.
        """
        root = mjcf.parse(self.xml)
        _write_chain(root, self.chain)
        path = Path(path)
        if self.folder is not None and path.resolve().parent != self.folder:
            mjcf.anchor(root, self.folder)
        part = path.with_name(f".{path.name}.part")
        try:
            part.write_text(mjcf.to_text(root), encoding="utf-8")
            part.replace(path)
        except OSError as error:
            with suppress(OSError):
                part.unlink()
            raise FileError(f"cannot write {path} ({error.strerror}); expected a writable folder") from None

    def edited(self, edit: Callable[[ET.Element], None]) -> Rig:
        """The rig whose MJCF tree was changed by `edit`; the chain stays."""
        root = mjcf.parse(self.xml)
        edit(root)
        return replace(self, xml=mjcf.to_text(root))

    def with_chain(self, chain: Chain) -> Rig:
        """The same structure behind another measurement chain."""
        return replace(self, chain=chain)

    def connected(self, *, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> Rig:
        """The rig with only the named channels connected, in the order given (all when None)."""
        chain = self.chain
        if inputs is not None:
            chain = replace(chain, inputs=tuple(inputs))
        if outputs is not None:
            chain = replace(chain, outputs=tuple(outputs))
        return self.with_chain(chain)

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The compiled model; not to be changed."""
        return mjcf.compiled(self.xml, self.folder, "the model")

    @cached_property
    def name(self) -> str:
        """Name of the model."""
        return mjcf.parse(self.xml).get("model", "model")

    @cached_property
    def dofs(self) -> tuple[str, ...]:
        """Names of the degrees of freedom: the joints, in model order."""
        return tuple(ports.name_of(self.model, "joint", i) for i in range(self.model.njnt))

    @cached_property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that can move."""
        return tuple(
            ports.name_of(self.model, "body", i)
            for i in range(1, self.model.nbody)
            if self.model.body_weldid[i] != 0
        )

    @cached_property
    def springs(self) -> tuple[Spring, ...]:
        """Named joints and tendons that have stiffness or damping, in model order."""
        m = self.model
        found = []
        for i in range(m.njnt):
            dof = m.jnt_dofadr[i]
            law = (m.jnt_stiffness[i], m.dof_damping[dof], *m.jnt_stiffnesspoly[i], *m.dof_dampingpoly[dof])
            if m.joint(i).name and np.any(law):
                found.append(Spring(m.joint(i).name, "joint", i, float(m.qpos_spring[m.jnt_qposadr[i]])))
        for i in range(m.ntendon):
            law = (
                m.tendon_stiffness[i],
                m.tendon_damping[i],
                *m.tendon_stiffnesspoly[i],
                *m.tendon_dampingpoly[i],
            )
            if m.tendon(i).name and np.any(law):
                found.append(Spring(m.tendon(i).name, "tendon", i, float(np.mean(m.tendon_lengthspring[i]))))
        return tuple(found)

    def spring(self, name: str) -> Spring:
        """The spring of that name.

        Raises:
            UnknownNameError: there is none.
        """
        for spring in self.springs:
            if spring.name == name:
                return spring
        listed = ", ".join(spring.name for spring in self.springs) or "none"
        raise UnknownNameError(f"spring {name!r} does not exist in model {self.name!r}; there are {listed}")

    @cached_property
    def _ports(self) -> ports.Ports:
        return ports.find(self._tangent, self.operating_point)

    @cached_property
    def inputs(self) -> tuple[Channel, ...]:
        """Connected input channels: actuators."""
        return self._ports.pick_inputs(self.chain.inputs)[1]

    @cached_property
    def outputs(self) -> tuple[Channel, ...]:
        """Connected output channels: scalar sensors and the axes of vector sensors."""
        return self._ports.pick_outputs(self.chain.outputs)[1]

    @cached_property
    def responding(self) -> tuple[str, ...]:
        """Names of the outputs that the structure can move at all (an axis across all motion stays silent)."""
        system = self._everything
        n = len(self._ports.inputs)
        felt = np.any(system.C != 0, axis=1) | np.any(system.D[:, :n] != 0, axis=1)
        return tuple(c.name for c, moves in zip(system.outputs, felt, strict=True) if moves)

    @cached_property
    def operating_point(self) -> Array:
        """Joint positions of static equilibrium at zero control, shape (n_dofs,) [m or rad]."""
        return linearize.equilibrium(self.model)

    @cached_property
    def linear(self) -> bool:
        """Whether the structure is linear as written, for motion of any size."""
        return self.smooth and self.straight

    @cached_property
    def smooth(self) -> bool:
        """Whether the structure has no kinks (deadbands, dry friction, limits, contacts, clipped signals)."""
        return tangent.is_smooth(self.model)

    @cached_property
    def straight(self) -> bool:
        """Whether, kinks aside, forces and readings are linear in the motion at any amplitude."""
        return tangent.is_straight(self.model)

    @cached_property
    def _tangent(self) -> mujoco.MjModel:
        return tangent.tangent(self.model, self.operating_point)

    def second_order(self) -> SecondOrder:
        """True M, C, K for small motion about the operating point, kinks left alone (see `lab.tangent`).

        Raises:
            RigError: the model has equality constraints, which M, C, K cannot hold.
        """
        return self._second_order

    @cached_property
    def _second_order(self) -> SecondOrder:
        M, C_d, K = linearize.matrices(self._tangent, self.operating_point, analytic=self.straight)
        return SecondOrder(M, C_d, K, self.dofs)

    @cached_property
    def _linearized(self) -> tuple[Array, Array, Array, Array]:
        return linearize.state_space(self._tangent, self.operating_point, exact=self.straight)

    @cached_property
    def _everything(self) -> StateSpace:
        A, B, C, D = self._linearized
        forces = tuple(Channel(f"force on {dof}", "N", dof) for dof in self.dofs)
        rows, visible = self._ports.rows, len(self._ports.inputs)
        # Force laws are actuators without a port: they stand behind all others.
        columns = [*range(visible), *range(self.model.nu, B.shape[1])]
        inputs = self._ports.inputs + forces
        return StateSpace(
            A, B[:, columns], C[rows], D[np.ix_(rows, columns)], 0.0, inputs, self._ports.outputs
        )

    def row_of(self, output: str) -> int:
        """Position of an output channel in MuJoCo's `sensordata`."""
        return self._ports.rows[self._ports.pick_outputs([output])[0][0]]

    def control_of(self, input_: str) -> int:
        """Position of an input channel among MuJoCo's controls."""
        return self._ports.pick_inputs([input_])[0][0]

    @property
    def feedthrough(self) -> Array:
        """Jump of `sensordata` per unit step of each control, then of each force on a degree of freedom."""
        return self._linearized[3]

    def state_space(self) -> StateSpace:
        """True continuous model from the connected inputs to the connected outputs, state (q, q̇, activation)."""
        system = self._everything
        columns, inputs = self._ports.pick_inputs(self.chain.inputs)
        rows, outputs = self._ports.pick_outputs(self.chain.outputs)
        return StateSpace(
            system.A,
            system.B[:, columns],
            system.C[rows],
            system.D[np.ix_(rows, columns)],
            0.0,
            inputs,
            outputs,
        )

    def force_response(self) -> StateSpace:
        """True continuous model from a force on each degree of freedom to the connected outputs."""
        system = self._everything
        rows, outputs = self._ports.pick_outputs(self.chain.outputs)
        n = len(self._ports.inputs)
        return StateSpace(
            system.A, system.B[:, n:], system.C[rows], system.D[rows, n:], 0.0, system.inputs[n:], outputs
        )

    def modes(self) -> Modes:
        """True modes, with shapes at the connected outputs."""
        return self.state_space().modes()

    def extensions(self, position: Array) -> Array:
        """Extension of every spring [m or rad], shape (n_springs, n), at positions (n_dofs, n) from the operating point."""
        m = self.model
        data = mujoco.MjData(m)
        position = np.atleast_2d(position)
        values = np.empty((len(self.springs), position.shape[1]))
        tendons = [(row, s) for row, s in enumerate(self.springs) if s.kind == "tendon"]
        for row, s in enumerate(self.springs):
            if s.kind == "joint":
                address = m.jnt_qposadr[s.index]
                values[row] = self.operating_point[address] + position[address] - s.reference
        for k in range(position.shape[1] if tendons else 0):
            data.qpos[:] = self.operating_point + position[:, k]
            mujoco.mj_kinematics(m, data)
            mujoco.mj_comPos(m, data)
            mujoco.mj_tendon(m, data)
            for row, s in tendons:
                values[row, k] = data.ten_length[s.index] - s.reference
        return values

    def __repr__(self) -> str:
        return (
            f"Rig({self.name}: {len(self.dofs)} dofs, {len(self.springs)} springs, {len(self.inputs)} inputs, "
            f"{len(self.outputs)} outputs, {self.chain!r})"
        )


def _read_chain(root: ET.Element) -> Chain:
    for text in root.iterfind(f"custom/text[@name='{CHAIN_TEXT}']"):
        try:
            return Chain.from_data(json.loads(text.get("data", "")))
        except json.JSONDecodeError as error:
            raise RigError(
                f"the custom text {CHAIN_TEXT!r} is not JSON ({error}); expected what the lab writes"
            ) from None
    return Chain()


def _write_chain(root: ET.Element, chain: Chain) -> None:
    for custom in root.findall("custom"):
        for text in custom.findall(f"text[@name='{CHAIN_TEXT}']"):
            custom.remove(text)
        if not len(custom):
            root.remove(custom)
    if chain != Chain():
        place = root.find("custom")
        place = ET.SubElement(root, "custom") if place is None else place
        ET.SubElement(place, "text", name=CHAIN_TEXT, data=json.dumps(chain.to_data()))
