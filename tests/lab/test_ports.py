"""Channels of a model: names, units, the degree of freedom each one belongs to and its factor."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.errors import RigError, UnknownNameError
from lab.rig import Rig

BENCH = """<mujoco><compiler angle="degree"/><option gravity="{gravity}"><flag contact="disable"/></option><worldbody>
<site name="wall" pos="-1 0 0"/>
<body name="cart"><joint name="x" type="slide" axis="1 0 0" stiffness="50"/><geom size="0.1" mass="2"/>
  <site name="straight"/><site name="backward" euler="0 0 180"/><site name="askew" euler="0 0 60"/>
  <site name="upright" euler="0 -90 0"/>
  <body name="arm" pos="0 0 -0.1"><joint name="turn" type="hinge" axis="0 1 0" stiffness="4"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1"/><site name="tip" pos="0 0 -0.5"/></body>
</body></worldbody>
<tendon><fixed name="belt" stiffness="1"><joint joint="x" coef="1"/><joint joint="turn" coef="0.5"/></fixed>
<spatial name="rope"><site site="wall"/><site site="straight"/></spatial></tendon>
<actuator>{actuators}</actuator><sensor>{sensors}</sensor></mujoco>"""


def bench(*, actuators="", sensors="", gravity="0 0 0"):
    return Rig.from_xml(BENCH.format(actuators=actuators, sensors=sensors, gravity=gravity))


def facts(channel):
    return channel.unit, channel.dof, channel.factor


@pytest.mark.parametrize(
    ("actuator", "unit", "dof", "factor"),
    [
        ('<motor name="u" joint="x"/>', "N", "x", 1.0),
        ('<motor name="u" joint="x" gear="-2.5"/>', "N", "x", -2.5),
        ('<motor name="u" joint="turn" gear="3"/>', "N m", "turn", 3.0),
        ('<general name="u" joint="x" gainprm="7" gear="2"/>', "N", "x", 14.0),
        ('<position name="u" joint="x" kp="40"/>', "m", "x", 40.0),
        ('<position name="u" joint="turn" kp="40" kv="2"/>', "rad", "turn", 40.0),
        ('<velocity name="u" joint="x" kv="6"/>', "m/s", "x", 6.0),
        ('<velocity name="u" joint="turn" kv="6"/>', "rad/s", "turn", 6.0),
        ('<intvelocity name="u" joint="x" kp="5" actrange="-1 1"/>', "m/s", "x", 5.0),
        ('<general name="u" joint="x" dyntype="filter" dynprm="0.1" gainprm="3"/>', "N", "x", 3.0),
        ('<motor name="u" tendon="belt"/>', "N", "", 1.0),
        ('<motor name="u" site="straight" gear="1 0 0 0 0 0"/>', "N", "x", 1.0),
        ('<motor name="u" site="askew" gear="1 0 0 0 0 0"/>', "N", "x", 0.5),
        ('<motor name="u" site="tip" gear="0 0 1 0 0 0"/>', "N", "", 1.0),
    ],
)
def test_inputs(actuator, unit, dof, factor):
    (channel,) = bench(actuators=actuator).inputs
    assert (channel.unit, channel.dof) == (unit, dof)
    # A cosine of 60 degrees comes out of a rotation: a few roundings.
    assert channel.factor == pytest.approx(factor, rel=1e-14)


def test_a_vertical_push_at_the_tip_moves_nothing():
    """The arm hangs straight down, so that a force along it does no work on any joint."""
    rig = bench(actuators='<motor name="u" site="tip" gear="0 0 1 0 0 0"/>')
    assert not rig.state_space().B.any()


SENSORS = {
    "straight": ("m/s^2", "x", 1.0),
    "backward": ("m/s^2", "x", -1.0),
    "askew": ("m/s^2", "x", 0.5),
}


@pytest.mark.parametrize("gravity", ["0 0 0", "0 0 -9.81"])
@pytest.mark.parametrize("site", SENSORS)
def test_accelerometers_mounted_in_any_direction(site, gravity):
    rig = bench(sensors=f'<accelerometer name="a" site="{site}"/>', gravity=gravity)
    assert [c.name for c in rig.outputs] == ["a.x", "a.y", "a.z"]
    first = rig.outputs[0]
    assert (first.unit, first.dof) == SENSORS[site][:2]
    assert first.factor == pytest.approx(SENSORS[site][2], rel=1e-14)
    assert rig.outputs[2].dof == ""


def test_sideways_axis_of_a_slanted_sensor_carries_the_rest():
    rig = bench(sensors='<accelerometer name="a" site="askew"/>')
    assert rig.outputs[1].dof == "x"
    assert rig.outputs[1].factor == pytest.approx(-np.sqrt(3) / 2, rel=1e-14)


def test_axes_across_all_motion_do_not_respond():
    rig = bench(sensors='<accelerometer name="a" site="straight"/><accelerometer name="b" site="backward"/>')
    assert rig.responding == ("a.x", "b.x")
    rig = bench(sensors='<accelerometer name="a" site="upright"/>', gravity="0 0 -9.81")
    assert rig.responding == ("a.z",)
    assert facts(rig.outputs[2]) == ("m/s^2", "x", -1.0)


@pytest.mark.parametrize(
    ("sensor", "expected"),
    [
        ('<jointpos name="y" joint="x"/>', {"y": ("m", "x", 1.0)}),
        ('<jointvel name="y" joint="x"/>', {"y": ("m/s", "x", 1.0)}),
        ('<jointpos name="y" joint="turn"/>', {"y": ("rad", "turn", 1.0)}),
        ('<jointvel name="y" joint="turn"/>', {"y": ("rad/s", "turn", 1.0)}),
        ('<tendonpos name="y" tendon="belt"/>', {"y": ("m", "", 1.0)}),
        ('<tendonvel name="y" tendon="rope"/>', {"y": ("m/s", "x", 1.0)}),
        ('<tendonpos name="y" tendon="rope"/>', {"y": ("m", "x", 1.0)}),
        ('<actuatorfrc name="y" actuator="pull"/>', {"y": ("N", "", 1.0)}),
        ('<actuatorfrc name="y" actuator="twist"/>', {"y": ("N m", "", 1.0)}),
        ('<actuatorpos name="y" actuator="pull"/>', {"y": ("m", "x", 2.0)}),
        ('<actuatorvel name="y" actuator="twist"/>', {"y": ("rad/s", "turn", 1.0)}),
        (
            '<gyro name="y" site="tip"/>',
            {"y.x": ("rad/s", "", 1.0), "y.y": ("rad/s", "turn", 1.0), "y.z": ("rad/s", "", 1.0)},
        ),
        # The tip moves with the cart and with the arm: no single degree of freedom.
        (
            '<velocimeter name="y" site="tip"/>',
            {"y.x": ("m/s", "", 1.0), "y.y": ("m/s", "", 1.0), "y.z": ("m/s", "", 1.0)},
        ),
        (
            '<framepos name="y" objtype="site" objname="straight"/>',
            {"y.x": ("m", "x", 1.0), "y.y": ("m", "", 1.0), "y.z": ("m", "", 1.0)},
        ),
        (
            '<force name="y" site="straight"/>',
            {"y.x": ("N", "", 1.0), "y.y": ("N", "", 1.0), "y.z": ("N", "", 1.0)},
        ),
        # A quaternion, a clock: no signal of a modal test.
        ('<framequat name="y" objtype="site" objname="tip"/><clock name="t"/>', {}),
    ],
)
def test_outputs(sensor, expected):
    actuators = '<motor name="pull" joint="x" gear="2"/><motor name="twist" joint="turn"/>'
    rig = bench(actuators=actuators, sensors=sensor)
    assert {c.name: facts(c) for c in rig.outputs} == expected


def test_unnamed_channels_are_counted():
    sensors = '<jointpos name="pos" joint="x"/><jointvel joint="x"/><accelerometer site="straight"/>'
    rig = bench(actuators='<motor joint="x"/><motor joint="turn"/>', sensors=sensors)
    assert [c.name for c in rig.inputs] == ["actuator0", "actuator1"]
    assert [c.name for c in rig.outputs] == ["pos", "sensor1", "sensor2.x", "sensor2.y", "sensor2.z"]


def test_channels_of_one_name_are_refused():
    sensors = '<accelerometer name="a" site="straight"/><jointpos name="a.x" joint="x"/>'
    with pytest.raises(RigError, match=r"two sensors are called 'a\.x'"):
        bench(sensors=sensors)


def test_muscles_are_refused():
    with pytest.raises(RigError, match=r"'u' is a muscle.*expected a motor"):
        bench(actuators='<muscle name="u" tendon="rope" lengthrange="0.5 1.5"/>')


def test_unknown_channels_are_answered_with_those_that_exist():
    rig = bench(actuators='<motor name="pull" joint="x"/>', sensors='<jointpos name="pos" joint="x"/>')
    with pytest.raises(UnknownNameError, match=r"output channel 'acc' does not exist.*there are pos$"):
        rig.connected(outputs=["acc"])
    with pytest.raises(UnknownNameError, match=r"input channel 'push' does not exist.*there are pull$"):
        rig.connected(inputs=["push"])
    with pytest.raises(UnknownNameError, match="there are none"):
        bench().connected(outputs=["acc"])


@settings(max_examples=20)
@given(st.permutations(["s0", "s1.x", "s1.y", "s1.z", "s2"]), st.integers(1, 5))
def test_connected_channels_keep_the_order_asked_for(names, count):
    sensors = (
        '<jointpos name="s0" joint="x"/><velocimeter name="s1" site="tip"/><jointvel name="s2" joint="turn"/>'
    )
    rig = bench(sensors=sensors).connected(outputs=names[:count])
    assert [c.name for c in rig.outputs] == names[:count]
    # Rows of sensordata: s0 is 0, s1 is 1 to 3, s2 is 4.
    assert [rig.row_of(name) for name in names] == [
        ["s0", "s1.x", "s1.y", "s1.z", "s2"].index(n) for n in names
    ]


def test_factors_are_what_the_state_space_shows():
    """A channel with one degree of freedom reads factor times its motion: the definition, through the dynamics."""
    actuators = '<motor name="pull" joint="x" gear="2"/><motor name="twist" joint="turn" gear="-3"/>'
    sensors = (
        '<jointpos name="p" joint="x"/><gyro name="g" site="tip"/><accelerometer name="a" site="askew"/>'
    )
    rig = bench(actuators=actuators, sensors=sensors, gravity="0 0 -9.81")
    system, M = rig.state_space(), rig.second_order().mass
    n = len(rig.dofs)
    force = M @ system.B[n : 2 * n]
    for j, channel in enumerate(rig.inputs):
        expected = channel.factor * np.eye(n)[rig.dofs.index(channel.dof)]
        np.testing.assert_allclose(force[:, j], expected, atol=1e-11)
    selector = np.vstack([np.eye(2 * n), system.A[n:]])
    for row, channel in zip(system.C, rig.outputs, strict=True):
        if channel.dof:
            slot = {"displacement": 0, "velocity": 1, "acceleration": 2}[channel.quantity]
            motion = selector[slot * n + rig.dofs.index(channel.dof)]
            # Differences of a structure with a hinge: about 1e-12.
            np.testing.assert_allclose(row, channel.factor * motion, atol=1e-10 * np.max(np.abs(motion)))
