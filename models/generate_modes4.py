"""Writes modes4.xml and modes4_printed.xml: the simulated system of Juang (1992), thesis, section 6.1, in modal coordinates.

One unit mass on a spring and a dashpot for each of the four modes; each output is a fixed tendon whose length is a row of
the mode shapes. Frequencies are the damped ones of Table 2. Its damping column is printed upside down for modes 1 and 4:
only in the order below do the printed singular values come out. The second file has the column as printed.

The modal participation of the thesis has phases of its own, 2 l exp(j (φ + θ)). A force sets velocities and cannot give
these; a release from displacement and velocity can, so `release` below is the thesis' input, to the last digit.

Run `python models/generate_modes4.py` after a change.
"""

import cmath
import math
from pathlib import Path

DAMPED_FREQUENCIES = (1.000, 9.000, 9.003, 20.000)
DAMPING_RATIOS = (0.0499, 0.0022, 0.0022, 0.0025)
PRINTED_DAMPING_RATIOS = (0.0025, 0.0022, 0.0022, 0.0499)
SHAPES = ((1.0, 2.0, 2.002, 3.0), (2.0, 3.0, 3.003, 4.0), (1.0, 3.0, 3.003, 4.0), (0.0, 2.0, 2.002, 4.0))
MODULI = (1.0, 3.0, 3.5, 4.0)
SHAPE_PHASES = (0.0, math.pi / 3, 0.0, math.pi / 4)
PARTICIPATION_PHASES = (math.pi / 4, math.pi, math.pi / 3, 0.0)

HEADER = """<mujoco model="{name}">
  <!-- Written by generate_modes4.py. Juang (1992), section 6.1: four modes as slide joints, outputs as fixed tendons. -->
  <option integrator="RK4" gravity="0 0 0" timestep="0.001">
    <flag contact="disable"/>
  </option>
  <default>
    <geom type="box" size="0.12 0.12 0.12" rgba="0.30 0.45 0.60 1" mass="1.0"/>
    <tendon springlength="0"/>
  </default>
"""


def pole(mode: int, damping_ratios: tuple[float, ...] = DAMPING_RATIOS) -> complex:
    """λ = -ζω + j ω_d [rad/s]."""
    omega_d, zeta = 2 * math.pi * DAMPED_FREQUENCIES[mode], damping_ratios[mode]
    return complex(-zeta * omega_d / math.sqrt(1 - zeta**2), omega_d)


def release() -> tuple[dict[str, float], dict[str, float]]:
    """Displacement [m] and velocity [m/s] of each joint from which the outputs decay as eq. (6.3)."""
    displacement, velocity = {}, {}
    for mode, (phi, theta) in enumerate(zip(SHAPE_PHASES, PARTICIPATION_PHASES, strict=True)):
        amplitude = 2 * MODULI[mode] * cmath.exp(1j * (phi + theta))
        displacement[f"q{mode + 1}"] = amplitude.real
        velocity[f"q{mode + 1}"] = (pole(mode) * amplitude).real
    return displacement, velocity


def body(mode: int, damping_ratios: tuple[float, ...]) -> list[str]:
    eigenvalue = pole(mode, damping_ratios)
    spring, dashpot = abs(eigenvalue) ** 2, -2 * eigenvalue.real
    return [
        f'    <body name="mode{mode + 1}" pos="{0.5 * mode} 0 0.5">',
        f'      <joint name="q{mode + 1}" type="slide" axis="0 0 1" stiffness="{spring!r}" damping="{dashpot!r}"/>',
        f'      <geom name="block{mode + 1}"/>',
        f'      <site name="site{mode + 1}"/>',
        "    </body>",
    ]


def tendon(name: str, coefficients: tuple[float, ...]) -> str:
    joints = "".join(f'<joint joint="q{k + 1}" coef="{c!r}"/>' for k, c in enumerate(coefficients) if c)
    return f'    <fixed name="{name}">{joints}</fixed>'


def write(name: str, damping_ratios: tuple[float, ...]) -> None:
    numbers = range(1, len(SHAPES) + 1)
    lines = [
        "  <worldbody>",
        *(line for mode in range(len(MODULI)) for line in body(mode, damping_ratios)),
        "  </worldbody>",
        "  <tendon>",
        *(tendon(f"output{i}", row) for i, row in zip(numbers, SHAPES, strict=True)),
        "  </tendon>",
        "  <actuator>",
        *(f'    <motor name="force{i}" joint="q{i}"/>' for i in numbers),
        "  </actuator>",
        "  <sensor>",
        *(f'    <tendonpos name="y{i}" tendon="output{i}"/>' for i in numbers),
        *(f'    <accelerometer name="acc{i}" site="site{i}"/>' for i in numbers),
        "  </sensor>",
        "</mujoco>",
        "",
    ]
    (Path(__file__).parent / f"{name}.xml").write_text(HEADER.format(name=name) + "\n".join(lines))


def main() -> None:
    write("modes4", DAMPING_RATIOS)
    write("modes4_printed", PRINTED_DAMPING_RATIOS)


if __name__ == "__main__":
    main()
