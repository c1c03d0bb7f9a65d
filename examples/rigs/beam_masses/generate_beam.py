"""Writes beam.xml: the cantilever with six nuts as a chain of rigid pieces on elastic hinges.

    python examples/rigs/beam_masses/generate_beam.py

Free length, thickness and places of the nuts are documented; a nut is the 2.96 % of the mass that goes first. Width and
material are not: 25 mm of steel stand for them, and the stiffness is chosen so that the lowest frequency is the measured
21.9 Hz, which no change of frequencies depends on.
"""

from pathlib import Path

LENGTH, THICKNESS, WIDTH, DENSITY = 0.38, 4.75e-3, 25e-3, 7850.0
PIECES, NUTS, NUT_SHARE = 38, 6, 0.0296
MODULUS = 1.687e11

piece = LENGTH / PIECES
strip = LENGTH * THICKNESS * WIDTH * DENSITY
nut = NUT_SHARE * strip / (1 - NUTS * NUT_SHARE)
hinge = MODULUS * WIDTH * THICKNESS**3 / 12 / piece
size = f"{piece / 2:.6g} {WIDTH / 2:.6g} {THICKNESS / 2:.6g}"

head, tail = [], []
for i in range(PIECES):
    # The clamp holds half a piece, so that its hinge is twice as stiff and every curvature has its own length.
    first = i == 0
    head.append(
        f'<body name="piece{i + 1}" pos="{0 if first else piece:.6g} 0 0">'
        f'<joint name="hinge{i + 1}" type="hinge" axis="0 -1 0" stiffness="{(2 if first else 1) * hinge:.6g}" '
        f'damping="{(2 if first else 1) * 2e-5 * hinge:.6g}"/>'
        f'<geom type="box" pos="{piece / 2:.6g} 0 0" size="{size}" mass="{strip / PIECES:.6g}"/>'
    )
    for number in range(1, NUTS + 1):
        place = 0.05 * number - i * piece
        if 0 <= place - 1e-9 < piece:
            head.append(
                f'<body name="nut{number}" pos="{place:.6g} 0 0"><geom type="cylinder" size="0.006 0.005" '
                f'pos="0 0 {-THICKNESS / 2 - 0.005:.6g}" mass="{nut:.6g}"/></body>'
            )
    if i == 1:
        head.append('<site name="hammer"/>')
    if i == PIECES - 1:
        head.append(f'<site name="tip" pos="{piece:.6g} 0 0"/>')
    tail.append("</body>")

text = f"""<mujoco model="beam_masses">
  <!-- Cantilever with six nuts, {1e3 * LENGTH:.0f} mm free, {1e3 * THICKNESS:.2f} mm thick; written by generate_beam.py. -->
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
