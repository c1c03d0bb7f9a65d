"""Structures for placements: a row of masses with sensors and actuators on each."""

from lab.rig import Rig


def row_of_masses(n, *, mass=2.0, stiffness=800.0, damping=0.8, forces=True, pair="accelerometer"):
    """Masses one metre apart along x, joined by springs, the first one to the ground too."""
    bodies, tendons, actuators, sensors = [], [], [], []
    for i in range(1, n + 1):
        bodies.append(
            f'<body name="m{i}" pos="{i} 0 0"><joint name="x{i}" type="slide" axis="1 0 0"/>'
            f'<geom size="0.1" mass="{mass}"/><site name="s{i}"/></body>'
        )
        ends = f'<joint joint="x{i}" coef="1"/>' + (f'<joint joint="x{i - 1}" coef="-1"/>' if i > 1 else "")
        tendons.append(f'<fixed name="k{i}" stiffness="{stiffness}" damping="{damping}">{ends}</fixed>')
        actuators.append(f'<motor name="f{i}" joint="x{i}"/>')
        if pair == "accelerometer":
            sensors.append(f'<accelerometer name="a{i}" site="s{i}"/>')
        else:
            sensors.append(f'<jointpos name="a{i}" joint="x{i}"/>')
    rig = Rig.from_xml(
        '<mujoco model="row"><option integrator="RK4" gravity="0 0 0" timestep="0.001"><flag contact="disable"/></option>'
        f'<default><geom type="sphere"/><tendon springlength="0"/></default><worldbody>{"".join(bodies)}</worldbody>'
        f"<tendon>{''.join(tendons)}</tendon><actuator>{''.join(actuators) if forces else ''}</actuator>"
        f"<sensor>{''.join(sensors)}</sensor></mujoco>"
    )
    return rig.connected(outputs=rig.responding)
