"""X-braced trusses in a plane, fixed at both ends, with bars as spatial or as fixed tendons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.blind_cases.structure import Body, Port, Spring, Structure

Node = tuple[int, int]


@dataclass(frozen=True)
class Truss(Structure):
    """Nodes that move in a plane, tied by bars.

    Attributes:
        nodes: bay and level of every free node, in the order of the bodies.
        ends: nodes of every bar, in the order of the springs.
        spatial: whether bars are spatial tendons, with the geometry that they really have.
    """

    nodes: tuple[Node, ...] = ()
    ends: tuple[tuple[Node, Node], ...] = ()
    spatial: bool = False

    @property
    def xml(self) -> str:
        """MJCF."""
        bodies = "".join(
            f'<body name="{body.name}" pos="{x} 0 {z}"><joint name="u{x}{z}" type="slide" axis="1 0 0"/>'
            f'<joint name="w{x}{z}" type="slide" axis="0 0 1"/><geom type="sphere" size="0.05" mass="{body.mass!r}"/>'
            f'<site name="at{x}{z}"/></body>'
            for body, (x, z) in zip(self.bodies, self.nodes, strict=True)
        )
        held = sorted({end for pair in self.ends for end in pair} - set(self.nodes))
        bodies += "".join(f'<site name="at{x}{z}" pos="{x} 0 {z}"/>' for x, z in held)
        bars = "".join(self._bar(spring, *ends) for spring, ends in zip(self.springs, self.ends, strict=True))
        motors = "".join(f'<motor name="{port.name}" joint="{self.dofs[port.dof]}"/>' for port in self.inputs)
        seen = sorted({port.name.partition(".")[0] for port in self.outputs})
        sensors = "".join(f'<accelerometer name="{name}" site="at{name[3:]}"/>' for name in seen)
        return (
            '<mujoco model="truss"><option gravity="0 0 0"><flag contact="disable"/></option>'
            f"<worldbody>{bodies}</worldbody><tendon>{bars}</tendon><actuator>{motors}</actuator>"
            f"<sensor>{sensors}</sensor></mujoco>"
        )

    def _bar(self, spring: Spring, a: Node, b: Node) -> str:
        law = f'name="{spring.name}" stiffness="{spring.stiffness!r}" damping="{spring.damping!r}"'
        if self.spatial:
            length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
            sites = f'<site site="at{a[0]}{a[1]}"/><site site="at{b[0]}{b[1]}"/>'
            return f'<spatial {law} springlength="{length!r}">{sites}</spatial>'
        joints = "".join(f'<joint joint="{self.dofs[dof]}" coef="{c!r}"/>' for dof, c in spring.row)
        return f'<fixed {law} springlength="0">{joints}</fixed>'


def draw_truss(rng: np.random.Generator) -> Truss:
    """Three or four bays, two shakers, a few accelerometers."""
    bays = int(rng.integers(3, 5))
    nodes = tuple((x, z) for x in range(1, bays) for z in (0, 1))
    pairs = [((x, z), (x + 1, z)) for x in range(bays) for z in (0, 1)]
    pairs += [((x, 0), (x, 1)) for x in range(1, bays)]
    pairs += [((x, z), (x + 1, 1 - z)) for x in range(bays) for z in (0, 1)]
    scale = float(np.exp(rng.uniform(np.log(2e4), np.log(1e5))))
    springs = tuple(_bar_spring(rng, a, b, nodes, scale) for a, b in pairs)
    bodies = tuple(
        Body(f"node{x}{z}", float(np.round(rng.uniform(2.0, 8.0), 2)), (2 * i, 2 * i + 1))
        for i, (x, z) in enumerate(nodes)
    )
    n_seen = max(2, round(0.75 * len(nodes)))
    seen = sorted(int(i) for i in rng.choice(len(nodes), size=n_seen, replace=False))
    outputs = [
        Port(f"acc{nodes[i][0]}{nodes[i][1]}.{axis}", 2 * i + k, "acceleration")
        for i in seen
        for k, axis in enumerate("xz")
    ]
    shaken = sorted(int(i) for i in rng.choice(2 * len(nodes), size=2, replace=False))
    names = tuple(f"{letter}{x}{z}" for x, z in nodes for letter in "uw")
    tied = {frozenset(pair) for pair in pairs}
    untied = [(a, b) for k, a in enumerate(nodes) for b in nodes[k + 1 :] if frozenset((a, b)) not in tied]
    return Truss(
        bodies,
        springs,
        tuple(Port(f"push_{names[i]}", i) for i in shaken),
        tuple(outputs),
        names,
        tuple(f"node{a[0]}{a[1]}|node{b[0]}{b[1]}" for a, b in untied),
        nodes,
        tuple(pairs),
        bool(rng.random() < 0.5),
    )


def _bar_spring(rng: np.random.Generator, a: Node, b: Node, nodes: tuple[Node, ...], scale: float) -> Spring:
    along = np.subtract(b, a) / np.hypot(*np.subtract(b, a))
    row = []
    for end, sign in ((a, -1.0), (b, 1.0)):
        if end in nodes:
            i = nodes.index(end)
            row += [(2 * i + k, float(sign * along[k])) for k in (0, 1) if along[k]]
    k = float(f"{scale * rng.uniform(0.7, 1.4):.4g}")
    c = float(f"{2 * rng.uniform(0.008, 0.02) * np.sqrt(k * 5.0):.4g}")
    return Spring(f"bar{a[0]}{a[1]}_{b[0]}{b[1]}", k, c, tuple(row))
