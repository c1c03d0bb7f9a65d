"""Truth of a structure: assembly, differences and pencil-and-paper agree."""

import numpy as np
import pytest

from lab import linearize
from lab.errors import RigError
from lab.rig import Rig
from tests.lab.structures import LINEAR, model, oscillator

G = 9.81


def frequencies(M, K):
    return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real))


@pytest.mark.parametrize("name", LINEAR)
def test_assembly_equals_differences(name):
    rig = model(name)
    assembled = linearize.matrices(rig.model, rig.operating_point, analytic=True)
    differenced = linearize.matrices(rig.model, rig.operating_point, analytic=False)
    for a, b in zip(assembled, differenced, strict=True):
        # No truncation on a linear model; rounding of forces over the step: 1e-16 a few times.
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13 * np.max(np.abs(a)))


@pytest.mark.parametrize("name", LINEAR)
def test_state_space_is_that_of_the_matrices(name):
    rig = model(name)
    M, C_d, K = linearize.matrices(rig.model, rig.operating_point, analytic=True)
    n = len(M)
    expected = np.linalg.solve(M, np.hstack([-K, -C_d]))
    for exact in (True, False):
        A, B, _, _ = linearize.state_space(rig.model, rig.operating_point, exact=exact)
        np.testing.assert_array_equal(A[:n], np.hstack([np.zeros((n, n)), np.eye(n)]))
        np.testing.assert_allclose(A[n:], expected, rtol=0, atol=2e-13 * np.max(np.abs(expected)))
        # The last columns of B are forces on the degrees of freedom: the inverse of the mass matrix.
        np.testing.assert_allclose(B[n:, -n:], np.linalg.inv(M), rtol=1e-12, atol=0)


@pytest.mark.parametrize("name", LINEAR)
def test_sensors_read_what_their_name_says(name):
    """Positions read the state, accelerometers the equation of motion, and nothing else."""
    rig = model(name)
    A, B, C, D = linearize.state_space(rig.model, rig.operating_point, exact=True)
    n = len(rig.dofs)
    for channel in rig.outputs:
        row = rig.row_of(channel.name)
        if not channel.dof:
            assert not C[row].any()
            assert not D[row].any()
            continue
        i = rig.dofs.index(channel.dof)
        if channel.quantity == "acceleration":
            np.testing.assert_allclose(C[row], A[n + i], rtol=1e-14, atol=1e-14 * np.max(np.abs(A[n + i])))
            np.testing.assert_allclose(D[row], B[n + i], rtol=1e-14, atol=0)
        else:
            np.testing.assert_array_equal(C[row], np.eye(2 * n)[i + n * (channel.quantity == "velocity")])
            assert not D[row].any()


def pendulum(lengths, masses, *, start_deg=0.0):
    """MJCF of point masses on massless rods, each hinged to the one before, hanging in gravity."""
    head, tail = "", ""
    for i, (length, mass) in enumerate(zip(lengths, masses, strict=True)):
        above = 0.0 if i == 0 else -lengths[i - 1]
        turn = f'euler="0 {start_deg} 0"' if i == 0 else ""
        head += f"""<body name="rod{i}" pos="0 0 {above!r}" {turn}><joint name="a{i}" type="hinge" axis="0 1 0"/>
        <inertial pos="0 0 {-length!r}" mass="{mass!r}" diaginertia="1e-13 1e-13 1e-13"/>
        <site name="tip{i}" pos="0 0 {-length!r}"/>"""
        tail += "</body>"
    return f"""<mujoco><option gravity="0 0 {-G}"/><worldbody>{head}{tail}</worldbody>
    <actuator><motor name="torque" joint="a0"/></actuator>
    <sensor><accelerometer name="acc" site="tip0"/><jointpos name="angle" joint="a0"/></sensor></mujoco>"""


def test_double_pendulum():
    L, m = 0.7, 1.3
    rig = Rig.from_xml(pendulum([L, L], [m, m]))
    structure = rig.second_order()
    # Two equal pendulums: ω² = (2 ± √2) g / L, Landau and Lifshitz, Mechanics, § 23, problem 2.
    expected = np.sqrt((2 + np.array([-1, 1]) * np.sqrt(2)) * G / L)
    np.testing.assert_allclose(frequencies(structure.mass, structure.stiffness), expected, rtol=1e-10)
    # Angles between rods: T = m L²/2 (a² + (2 a + b)²), V = m g L (a² + (a + b)² / 2) for small ones.
    np.testing.assert_allclose(structure.mass, m * L**2 * np.array([[5, 2], [2, 1]]), rtol=1e-11)
    np.testing.assert_allclose(structure.stiffness, m * G * L * np.array([[3, 1], [1, 1]]), rtol=1e-10)
    assert not structure.damping.any()
    np.testing.assert_allclose(2 * np.pi * rig.modes().frequency_hz, expected, rtol=1e-10)


def test_pendulum_of_any_length_in_degrees_of_freedom():
    """Differences take steps in radians for hinges, whatever the size of the structure."""
    for length in (1e-3, 1.0, 400.0):
        rig = Rig.from_xml(pendulum([length], [2.0]))
        inertia = 2.0 * length**2 + 1e-13
        np.testing.assert_allclose(rig.second_order().stiffness, [[2.0 * G * length]], rtol=1e-10)
        np.testing.assert_allclose(rig.second_order().mass, [[inertia]], rtol=1e-12)


def test_pendulum_drawn_askew_hangs_straight():
    rig = Rig.from_xml(pendulum([0.5], [1.0], start_deg=30.0))
    np.testing.assert_allclose(rig.operating_point, [-np.pi / 6], rtol=1e-12)
    np.testing.assert_allclose(2 * np.pi * rig.modes().frequency_hz, [np.sqrt(G / 0.5)], rtol=1e-9)


HANGING = oscillator(stiffness=50.0, mass=2.0).replace('gravity="0 0 0"', f'gravity="{G} 0 0"')


def test_hanging_mass_sinks_and_keeps_its_frequency():
    rig = Rig.from_xml(HANGING)
    np.testing.assert_allclose(rig.operating_point, [2.0 * G / 50.0], rtol=1e-12)
    np.testing.assert_array_equal(rig.second_order().stiffness, [[50.0]])
    np.testing.assert_allclose(2 * np.pi * rig.modes().frequency_hz, [5.0], rtol=1e-14)


def test_hanging_mass_on_a_hardening_spring():
    k, k3, mass = 50.0, 400.0, 2.0
    rig = Rig.from_xml(HANGING.replace('stiffness="50.0"', f'stiffness="{k} 0 {k3}"'))
    roots = np.roots([k3, 0, k, -mass * G])
    x = roots[np.abs(roots.imag) < 1e-12].real[0]
    np.testing.assert_allclose(rig.operating_point, [x], rtol=1e-12)
    # Extrapolated central differences are exact for a cubic law.
    np.testing.assert_allclose(rig.second_order().stiffness, [[k + 3 * k3 * x**2]], rtol=1e-11)


def test_dry_friction_does_not_hold_the_mass_up():
    rig = Rig.from_xml(HANGING.replace('damping="0.4"', 'damping="0.4" frictionloss="100"'))
    np.testing.assert_allclose(rig.operating_point, [2.0 * G / 50.0], rtol=1e-12)
    np.testing.assert_allclose(rig.state_space().A, [[0, 1], [-25, -0.2]], rtol=1e-14)


def test_a_mass_that_nothing_holds_is_refused():
    with pytest.raises(RigError, match="no position of rest"):
        Rig.from_xml(HANGING.replace('stiffness="50.0"', 'stiffness="0"'))


FLOATING = """<mujoco><option gravity="0 0 0"><flag contact="disable"/></option><worldbody>
<body name="a"><joint name="xa" type="slide" axis="1 0 0"/><geom size="0.1" mass="1"/></body>
<body name="b"><joint name="xb" type="slide" axis="1 0 0"/><geom size="0.1" mass="3"/></body></worldbody>
<tendon><fixed name="ab" stiffness="6" springlength="0.2"><joint joint="xa" coef="-1"/><joint joint="xb" coef="1"/></fixed>
</tendon></mujoco>"""


def test_floating_structure_relaxes_and_has_a_rigid_body_motion():
    rig = Rig.from_xml(FLOATING)
    # The spring's rest length parts the masses; the mean position, which no spring holds, stays.
    np.testing.assert_allclose(rig.operating_point, [-0.1, 0.1], rtol=1e-12)
    np.testing.assert_allclose(rig.second_order().stiffness, [[6, -6], [-6, 6]], rtol=1e-14)
    np.testing.assert_allclose(
        frequencies(*[getattr(rig.second_order(), x) for x in ("mass", "stiffness")])[1], np.sqrt(8)
    )


def test_equality_constraints_have_no_matrices():
    rig = Rig.from_xml(FLOATING.replace("</mujoco>", '<equality><joint joint1="xa"/></equality></mujoco>'))
    with pytest.raises(RigError, match=r"1 equality constraint.*stiff springs"):
        rig.second_order()


def test_small_feedthrough_of_a_stiff_heavy_structure_is_kept():
    """1e4 kg at 1.6 kHz: the accelerometer's D is twelve digits below its C, and still there."""
    mass, k = 1e4, 1e12
    for stiffness in (f"{k!r}", f"{k!r} 0 1.0"):
        xml = oscillator(mass=mass, stiffness=k).replace(f'stiffness="{k!r}"', f'stiffness="{stiffness}"')
        system = Rig.from_xml(xml).connected(outputs=["acc.x"]).state_space()
        np.testing.assert_allclose(system.D, [[1 / mass]], rtol=1e-9)
        np.testing.assert_allclose(system.C[0, 0], -k / mass, rtol=1e-9)


def test_weak_inputs_are_kept_beside_strong_ones():
    weak = '<motor name="force" joint="x"/><motor name="weak" joint="x" gear="1e-11"/>'
    rig = Rig.from_xml(oscillator().replace('<motor name="force" joint="x"/>', weak))
    np.testing.assert_allclose(rig.state_space().B[1], [0.5, 0.5e-11], rtol=1e-14)
    assert rig.inputs[1].factor == 1e-11


def test_actuator_dynamics_are_states():
    """A first-order lag of 0.2 s before the force: one more state a with ȧ = (u - a) / 0.2."""
    for kind in ("filter", "filterexact"):
        lagging = f'<general name="force" joint="x" dyntype="{kind}" dynprm="0.2" gainprm="3"/>'
        system = Rig.from_xml(oscillator().replace('<motor name="force" joint="x"/>', lagging)).state_space()
        np.testing.assert_allclose(system.A, [[0, 1, 0], [-25, -0.2, 1.5], [0, 0, -5]], rtol=1e-14)
        np.testing.assert_allclose(system.B, [[0], [0], [5]], rtol=1e-14)
        # The accelerometer feels the activation, not the control.
        assert not system.D.any()


def test_servo_gain_is_stiffness_and_damping():
    servo = '<position name="force" joint="x" kp="70" kv="3"/>'
    rig = Rig.from_xml(oscillator().replace('<motor name="force" joint="x"/>', servo))
    np.testing.assert_array_equal(rig.second_order().stiffness, [[120.0]])
    np.testing.assert_array_equal(rig.second_order().damping, [[3.4]])
    differenced = linearize.matrices(rig.model, rig.operating_point, analytic=False)
    np.testing.assert_allclose(np.ravel(differenced), [2.0, 3.4, 120.0], rtol=1e-12)


def test_differences_are_of_fourth_order():
    """Halving the step divides the error of an extrapolated difference by 16."""
    point, errors = np.array([0.4]), []
    for h in (0.4, 0.2, 0.1):
        slope = linearize.differences(np.sin, point, np.array([h]))
        errors.append(abs(slope[0, 0] - np.cos(0.4)))
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    # The next term of the error is a sixteenth of its own at each halving.
    np.testing.assert_allclose(rates, 4, atol=0.05)
