"""Spring-mass networks along one line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.blind_cases.structure import Body, Port, Spring, Structure

GROUND = -1
PREFIX = {"acceleration": "acc", "velocity": "vel", "displacement": "pos"}
SENSOR = {
    "acceleration": '<accelerometer name="acc{0}" site="spot{0}"/>',
    "velocity": '<jointvel name="vel{0}" joint="q{0}"/>',
    "displacement": '<jointpos name="pos{0}" joint="q{0}"/>',
}


@dataclass(frozen=True)
class Network(Structure):
    """Masses that slide along one line, tied by springs."""

    @property
    def xml(self) -> str:
        """MJCF."""
        joints = {spring.name: spring for spring in self.springs if spring.joint}
        bodies = "".join(
            f'<body name="{body.name}" pos="{i} 0 0">{_joint(self.dofs[i], joints)}'
            f'<geom type="box" size="0.1 0.1 0.1" mass="{body.mass!r}"/><site name="spot{i + 1}"/></body>'
            for i, body in enumerate(self.bodies)
        )
        tendons = "".join(_tendon(spring, self.dofs) for spring in self.springs if not spring.joint)
        motors = "".join(f'<motor name="{port.name}" joint="{self.dofs[port.dof]}"/>' for port in self.inputs)
        sensors = "".join(SENSOR[port.quantity].format(port.dof + 1) for port in self.outputs)
        return (
            '<mujoco model="network"><option gravity="0 0 0"><flag contact="disable"/></option>'
            f"<worldbody>{bodies}</worldbody><tendon>{tendons}</tendon><actuator>{motors}</actuator>"
            f"<sensor>{sensors}</sensor></mujoco>"
        )


def _joint(name: str, joints: dict[str, Spring]) -> str:
    law = ""
    if name in joints:
        law = f' stiffness="{joints[name].stiffness!r}" damping="{joints[name].damping!r}"'
    return f'<joint name="{name}" type="slide" axis="1 0 0"{law}/>'


def _tendon(spring: Spring, dofs: Sequence[str]) -> str:
    joints = "".join(
        f'<joint joint="{dofs[dof]}" coef="{coefficient!r}"/>' for dof, coefficient in spring.row
    )
    law = f'stiffness="{spring.stiffness!r}" damping="{spring.damping!r}" springlength="0"'
    return f'<fixed name="{spring.name}" {law}>{joints}</fixed>'


def draw_network(
    rng: np.random.Generator,
    *,
    masses: tuple[int, int] = (3, 6),
    unsensed: float = 0.0,
    quantities: Sequence[str] = ("acceleration",),
) -> Network:
    """A chain on the ground with further springs and one or two shakers.

    Args:
        rng: what is drawn from.
        masses: least and most of them.
        unsensed: share of them without a sensor, at least one mass unless zero.
        quantities: what sensors may measure.
    """
    n = int(rng.integers(masses[0], masses[1] + 1))
    weights = [float(m) for m in np.round(rng.uniform(0.5, 2.5, n), 3)]
    pairs = [(GROUND, 0), *((i, i + 1) for i in range(n - 1))]
    further = [(GROUND, i) for i in range(1, n)] + [(i, j) for i in range(n) for j in range(i + 2, n)]
    order = rng.permutation(len(further))
    n_further = int(rng.integers(1, max(2, n // 2) + 1))
    pairs += [further[k] for k in sorted(order[:n_further])]
    # One pair at least stays untied, so that a spring may be missing.
    untied = [further[k] for k in sorted(order[n_further:])]
    scale = float(np.exp(rng.uniform(np.log(300.0), np.log(20000.0))))
    springs = [_spring(rng, a, b, scale, weights[b]) for a, b in pairs]
    shaken = sorted(int(i) for i in rng.choice(n, size=int(rng.integers(1, 3)), replace=False))
    n_sensed = n - (max(1, round(unsensed * n)) if unsensed else 0)
    seen = sorted(int(i) for i in rng.choice(n, size=n_sensed, replace=False))
    outputs = []
    for i in seen:
        quantity = str(rng.choice(list(quantities)))
        outputs.append(
            Port(f"{PREFIX[quantity]}{i + 1}" + (".x" if quantity == "acceleration" else ""), i, quantity)
        )
    return Network(
        tuple(Body(f"block{i + 1}", m, (i,)) for i, m in enumerate(weights)),
        tuple(springs),
        tuple(Port(f"push{i + 1}", i) for i in shaken),
        tuple(outputs),
        tuple(f"q{i + 1}" for i in range(n)),
        tuple(f"block{a + 1}|block{b + 1}" if a != GROUND else f"world|block{b + 1}" for a, b in untied),
    )


def _spring(rng: np.random.Generator, a: int, b: int, scale: float, mass: float) -> Spring:
    k = float(f"{scale * rng.uniform(0.5, 1.6):.4g}")
    c = float(f"{2 * rng.uniform(0.008, 0.03) * np.sqrt(k * mass):.4g}")
    if a != GROUND:
        return Spring(f"link{a + 1}_{b + 1}", k, c, ((a, -1.0), (b, 1.0)))
    joint = bool(rng.random() < 0.5)
    return Spring(f"q{b + 1}" if joint else f"base{b + 1}", k, c, ((b, 1.0),), joint)
