"""Writes truss.xml and truss_spatial.xml: the truss of De Angelis et al. (2002), Fig. 2.

Three X-braced unit bays between eight nodes; the four end nodes are fixed and the four nodes of the middle bay carry
100 kg each. EA = 10 000 N, so a bar of length L has stiffness EA / L. Damping is 0.01 M + 0.005 K: a dashpot of
0.01 m on every coordinate and 0.005 k on every bar.

In truss.xml each bar is a fixed tendon whose joint coefficients are the bar's direction cosines: exactly linear.
In truss_spatial.xml each bar is a spatial tendon between two sites: the real geometry, linear for small motion.

Run `python models/generate_truss.py` after a change.
"""

import math
from pathlib import Path

EA = 10_000.0
NODE_MASS = 100.0
MASS_DAMPING, STIFFNESS_DAMPING = 0.01, 0.005
FREE = {1: (1, 0), 2: (1, 1), 3: (2, 0), 4: (2, 1)}
FIXED = {5: (0, 0), 6: (0, 1), 7: (3, 0), 8: (3, 1)}
BARS = [
    (5, 1),
    (1, 3),
    (3, 7),
    (6, 2),
    (2, 4),
    (4, 8),
    (1, 2),
    (3, 4),
    (5, 2),
    (6, 1),
    (1, 4),
    (2, 3),
    (3, 8),
    (4, 7),
]

HEADER = """<mujoco model="{name}">
  <!-- Written by generate_truss.py. De Angelis et al. (2002), Fig. 2: {what}. -->
  <option integrator="RK4" gravity="0 0 0" timestep="0.001">
    <flag contact="disable"/>
  </option>
  <default>
    <geom type="sphere" size="0.05" rgba="0.30 0.45 0.60 1"/>
    <tendon{springlength}/>
  </default>
"""


def position(node: int) -> tuple[int, int]:
    return (FREE | FIXED)[node]


def length_of(bar: tuple[int, int]) -> float:
    return math.dist(position(bar[0]), position(bar[1]))


def node_bodies() -> list[str]:
    lines = []
    for node, (x, z) in FREE.items():
        damping = repr(MASS_DAMPING * NODE_MASS)
        lines += [
            f'    <body name="node{node}" pos="{x} 0 {z}">',
            f'      <joint name="u{node}" type="slide" axis="1 0 0" damping="{damping}"/>',
            f'      <joint name="v{node}" type="slide" axis="0 0 1" damping="{damping}"/>',
            f'      <geom name="ball{node}" mass="{NODE_MASS!r}"/>',
            f'      <site name="site{node}"/>',
            "    </body>",
        ]
    lines += [f'    <site name="site{node}" pos="{x} 0 {z}"/>' for node, (x, z) in FIXED.items()]
    return lines


def fixed_tendon(bar: tuple[int, int]) -> str:
    (xa, za), (xb, zb) = position(bar[0]), position(bar[1])
    length = length_of(bar)
    cosines = ((xb - xa) / length, (zb - za) / length)
    joints = "".join(
        f'<joint joint="{letter}{node}" coef="{sign * cosine!r}"/>'
        for node, sign in zip(bar, (-1, 1), strict=True)
        if node in FREE
        for letter, cosine in zip("uv", cosines, strict=True)
        if cosine
    )
    return f'    <fixed name="bar{bar[0]}_{bar[1]}" {law(bar)}>{joints}</fixed>'


def spatial_tendon(bar: tuple[int, int]) -> str:
    sites = "".join(f'<site site="site{node}"/>' for node in bar)
    return (
        f'    <spatial name="bar{bar[0]}_{bar[1]}" {law(bar)} springlength="{length_of(bar)!r}" width="0.012">'
        f"{sites}</spatial>"
    )


def law(bar: tuple[int, int]) -> str:
    stiffness = EA / length_of(bar)
    return f'stiffness="{stiffness!r}" damping="{STIFFNESS_DAMPING * stiffness!r}"'


def model(name: str, what: str, springlength: str, tendons: list[str]) -> str:
    dofs = [f"{letter}{node}" for node in FREE for letter in "uv"]
    lines = [
        "  <worldbody>",
        *node_bodies(),
        "  </worldbody>",
        "  <tendon>",
        *tendons,
        "  </tendon>",
        "  <actuator>",
        *(f'    <motor name="force_{dof}" joint="{dof}"/>' for dof in dofs),
        "  </actuator>",
        "  <sensor>",
        *(f'    <accelerometer name="acc{node}" site="site{node}"/>' for node in FREE),
        *(f'    <jointpos name="pos_{dof}" joint="{dof}"/>' for dof in dofs),
        "  </sensor>",
        "</mujoco>",
        "",
    ]
    return HEADER.format(name=name, what=what, springlength=springlength) + "\n".join(lines)


def main() -> None:
    here = Path(__file__).parent
    linear = model(
        "truss",
        "bars as fixed tendons, exactly linear",
        ' springlength="0"',
        [fixed_tendon(bar) for bar in BARS],
    )
    spatial = model(
        "truss_spatial", "bars as spatial tendons, real geometry", "", [spatial_tendon(bar) for bar in BARS]
    )
    (here / "truss.xml").write_text(linear)
    (here / "truss_spatial.xml").write_text(spatial)


if __name__ == "__main__":
    main()
