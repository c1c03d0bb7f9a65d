"""Writes beam.xml: the cantilever with six nuts as a chain of rigid pieces on elastic hinges.

    python examples/rigs/beam_masses/generate_beam.py

Free length, thickness and places of the nuts are documented; a nut is the 2.96 % of the strip's mass that goes first. Width
and material are not: 25 mm of steel stand for them. Stiffness of the strip, mass of the accelerometer, stiffness of the clamp
and the 10 mm by which the strip bends inside it are chosen so that the five lowest frequencies of 24 samples with all nuts,
each at its documented places, are met within a few tenths of a percent to 1 % (near 21.9, 138.6, 382, 741 and 1153 Hz); the
damping, so that resonances are about as wide, and the place of the force, 30 mm from the clamp, so that levels between them are
about right.
"""

from pathlib import Path

FREE, INSIDE, THICKNESS, WIDTH, DENSITY = 0.38, 0.01, 4.75e-3, 25e-3, 7850.0
PIECES, NUTS, NUT_SHARE = 39, 6, 0.0296
MODULUS, ACCELEROMETER, CLAMP = 2.491e11, 0.0505, 3.012e6
DAMPING_TIME = 4e-6
"""Damping over stiffness [s]."""

piece = (FREE + INSIDE) / PIECES
strip = (FREE + INSIDE) * THICKNESS * WIDTH * DENSITY
nut = NUT_SHARE * FREE * THICKNESS * WIDTH * DENSITY
hinge = MODULUS * WIDTH * THICKNESS**3 / 12 / piece
size = f"{piece / 2:.6g} {WIDTH / 2:.6g} {THICKNESS / 2:.6g}"


def spring(stiffness: float) -> str:
    """Stiffness and damping of a joint."""
    return f'stiffness="{stiffness:.6g}" damping="{DAMPING_TIME * stiffness:.6g}"'


head, tail = [], []
for i in range(PIECES):
    # The clamp holds half a piece, so that its hinge is twice as stiff and every curvature has its own length.
    first = i == 0
    clamp = f'<joint name="clamp" type="slide" axis="0 0 1" {spring(CLAMP)}/>' if first else ""
    head.append(
        f'<body name="piece{i + 1}" pos="{0 if first else piece:.6g} 0 0">{clamp}'
        f'<joint name="hinge{i + 1}" type="hinge" axis="0 -1 0" {spring((2 if first else 1) * hinge)}/>'
        f'<geom type="box" pos="{piece / 2:.6g} 0 0" size="{size}" mass="{strip / PIECES:.6g}"/>'
    )
    for number in range(1, NUTS + 1):
        place = INSIDE + 0.05 * number - i * piece
        if 0 <= place - 1e-9 < piece:
            head.append(
                f'<body name="nut{number}" pos="{place:.6g} 0 0"><geom type="cylinder" size="0.006 0.005" '
                f'pos="0 0 {-THICKNESS / 2 - 0.005:.6g}" mass="{nut:.6g}"/></body>'
            )
    if i == 4:
        head.append('<site name="hammer"/>')
    if i == PIECES - 1:
        head.append(
            f'<body name="accelerometer" pos="{piece:.6g} 0 0"><geom type="cylinder" size="0.008 0.008" '
            f'pos="0 0 {THICKNESS / 2 + 0.008:.6g}" mass="{ACCELEROMETER:.6g}"/><site name="tip"/></body>'
        )
    tail.append("</body>")

text = f"""<mujoco model="beam_masses">
  <!-- Cantilever with six nuts, {1e3 * FREE:.0f} mm free, {1e3 * THICKNESS:.2f} mm thick; written by generate_beam.py. -->
  <option integrator="RK4" gravity="0 0 0" timestep="0.00001"><flag contact="disable"/></option>
  <worldbody>
    {chr(10).join("    " + line for line in head).strip()}
    {"".join(tail)}
  </worldbody>
  <actuator><motor name="force" site="hammer" gear="0 0 1 0 0 0"/></actuator>
  <sensor><accelerometer name="tip" site="tip"/></sensor>
</mujoco>
"""
Path(__file__).with_name("beam.xml").write_text(text, encoding="utf-8")
