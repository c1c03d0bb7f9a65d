"""Rig: a structure and its measurement chain, known exactly, changed by copying, saved in one file."""

import math
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lab import instruments
from lab.chain import Chain
from lab.errors import FileError, RigError, UnknownNameError
from lab.mjcf import number
from lab.rig import Rig
from lab.stages import Gain, Hum, Lag, Noise
from tests.lab.structures import LINEAR, MODELS, chain_matrices, chain_xml, held_response, model, oscillator

CHAIN = Chain(
    actuators=(Lag("force", math.pi),),
    sensors=(Gain("acc.x", 1 / 3), Hum("pos", 50.0, math.e)),
    acquisition=(Noise("*", percent=5.0),),
)


# Truth.

positive = st.floats(0.1, 100.0)
spring = st.tuples(positive, st.floats(0.0, 1.0))


@st.composite
def networks(draw):
    """Masses, springs to the ground and springs between any pairs."""
    n = draw(st.integers(2, 6))
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
    joined = draw(st.dictionaries(st.sampled_from(pairs), spring, max_size=8))
    return (
        draw(st.lists(positive, min_size=n, max_size=n)),
        draw(st.lists(spring, min_size=n, max_size=n)),
        joined,
    )


@given(networks())
@settings(max_examples=25)
def test_truth_of_any_spring_mass_network(network):
    rig = Rig.from_xml(chain_xml(*network))
    M, C_d, K = chain_matrices(*network)
    found = rig.second_order()
    assert rig.linear
    for matrix, expected in (("mass", M), ("damping", C_d), ("stiffness", K)):
        # Sums in another order.
        scale = np.max(np.abs(expected), initial=1e-300)
        np.testing.assert_allclose(getattr(found, matrix), expected, rtol=0, atol=4e-15 * scale)
    n = len(M)
    state = rig.state_space()
    expected = np.linalg.solve(M, np.hstack([-K, -C_d]))
    np.testing.assert_allclose(state.A[n:], expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))
    np.testing.assert_allclose(state.B[n:], np.linalg.inv(M), rtol=1e-13)
    assert {s.name for s in rig.springs} == {f"q{i}" for i in range(n)} | {
        f"spring{a}_{b}" for a, b in network[2]
    }


@pytest.mark.parametrize("name", LINEAR)
def test_modes_are_those_of_the_matrices(name):
    """Twin: the quadratic eigenvalue problem by determinants, one mode at a time."""
    modes, structure = model(name).modes(), LINEAR[name][1]
    for pole in modes.poles:
        D = structure.mass * pole**2 + structure.damping * pole + structure.stiffness
        # Singular there to rounding.
        assert np.linalg.svd(D, compute_uv=False)[-1] < 1e-11 * np.max(np.abs(structure.stiffness))
    assert len(modes) == len(structure.dofs)


@pytest.mark.parametrize("name", LINEAR)
def test_state_space_gives_the_exact_response(name):
    """The rig's truth, sampled, against a recursion from M, C, K alone."""
    rate, structure = LINEAR[name]
    rig = model(name)
    rig = rig.connected(outputs=rig.responding)
    u = np.random.default_rng(0).standard_normal((len(rig.inputs), 200))
    expected = held_response(structure, rig.outputs, 1 / rate, u)
    found = rig.state_space().sampled(1 / rate).simulate(u)
    # Two exponentials of one matrix, and 200 steps.
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.max(np.abs(expected)))


def test_force_response_has_a_force_on_every_degree_of_freedom():
    rig = Rig.from_xml(oscillator(mass=2.0)).connected(inputs=[], outputs=["acc.x"])
    assert rig.state_space().D.shape == (1, 0)
    system = rig.force_response()
    assert [c.name for c in system.inputs] == ["force on x"]
    np.testing.assert_allclose(system.D, [[0.5]], rtol=1e-15)


# What there is.


def test_springs_bodies_and_names():
    rig = model("chain3_coupled")
    assert rig.dofs == ("x1", "x2", "x3")
    assert rig.bodies == ("mass1", "mass2", "mass3")
    assert [s.name for s in rig.springs] == ["x1", "x2", "x3", "spring1_2", "spring1_3", "spring2_3"]
    assert [s.kind for s in rig.springs] == ["joint"] * 3 + ["tendon"] * 3
    assert "3 dofs, 6 springs, 3 inputs" in repr(rig)
    with pytest.raises(
        UnknownNameError, match=r"spring 'x4' does not exist.*there are x1, x2, x3, spring1_2"
    ):
        rig.spring("x4")


def test_fixed_bodies_and_free_joints_are_no_springs_or_bodies():
    xml = oscillator().replace("<worldbody>", '<worldbody><body name="wall"><geom size="0.1"/></body>')
    rig = Rig.from_xml(xml.replace('stiffness="50.0" damping="0.4"', ""))
    assert rig.bodies == ("mass",)
    assert rig.springs == ()


def test_channels_in_the_order_connected():
    rig = model("chain3_coupled").connected(inputs=["force2"], outputs=["pos3", "acc1.x"])
    assert [c.name for c in rig.inputs] == ["force2"]
    assert [c.name for c in rig.outputs] == ["pos3", "acc1.x"]
    assert rig.control_of("force2") == 1
    assert rig.row_of("acc1.x") == 0
    system = rig.state_space()
    assert system.inputs == rig.inputs
    assert system.outputs == rig.outputs
    np.testing.assert_array_equal(system.C[0], [0, 0, 1, 0, 0, 0])


def test_extensions_of_joints_and_fixed_tendons():
    rig = model("chain3_coupled")
    q = np.random.default_rng(1).standard_normal((3, 5))
    expected = np.stack([*q, q[1] - q[0], q[2] - q[0], q[2] - q[1]])
    np.testing.assert_allclose(rig.extensions(q), expected, atol=1e-15)


def test_extensions_of_spatial_tendons_are_changes_of_length():
    rig = model("truss_spatial")
    q = 0.1 * np.random.default_rng(1).standard_normal((8, 3))
    bar = [s.name for s in rig.springs].index("bar1_4")
    # Nodes 1 and 4 lie on the diagonal of a unit square: degrees of freedom u1, v1 and u4, v4.
    ends = np.array([[1.0], [1.0]]) + q[6:8] - q[0:2]
    np.testing.assert_allclose(rig.extensions(q)[bar], np.hypot(*ends) - math.sqrt(2), atol=1e-14)


def test_extensions_count_from_the_rest_length():
    """Joint position minus its reference, tendon length minus its rest length, from where the structure rests."""
    xml = oscillator(
        extra='<tendon><fixed name="t" stiffness="30" springlength="0.2"><joint joint="x" coef="2"/></fixed></tendon>'
    )
    rig = Rig.from_xml(xml.replace('stiffness="50.0"', 'stiffness="50.0" springref="0.3"'))
    # 50 (x - 0.3) + 2 · 30 (2 x - 0.2) = 0.
    rest = (50 * 0.3 + 60 * 0.2) / 170
    np.testing.assert_allclose(rig.operating_point, [rest], rtol=1e-12)
    np.testing.assert_allclose(
        rig.extensions(np.array([[0.0, 0.1]])),
        [[rest - 0.3, rest - 0.2], [2 * rest - 0.2, 2 * rest]],
        rtol=1e-12,
    )


# Changes.


def test_a_changed_rig_is_another_rig():
    rig = Rig.from_xml(oscillator())

    def double(root):
        joint = root.find(".//joint")
        joint.set("stiffness", number(2 * float(joint.get("stiffness"))))

    stiffer = rig.edited(double).with_chain(CHAIN)
    assert rig.second_order().stiffness[0, 0] == 50.0
    assert stiffer.second_order().stiffness[0, 0] == 100.0
    assert rig.chain == Chain()
    assert stiffer.edited(double).chain == CHAIN


def test_matrices_cannot_be_changed_by_accident():
    with pytest.raises(ValueError, match="read-only"):
        model("chain7").second_order().mass[0, 0] = 2.0


# Files.


@pytest.mark.parametrize("name", [path.stem for path in MODELS.glob("*.xml")])
def test_models_survive_saving_to_the_last_bit(name, tmp_path):
    rig = model(name)
    rig.save(tmp_path / "saved.xml")
    again = Rig.load(tmp_path / "saved.xml")
    for matrix in ("mass", "damping", "stiffness"):
        np.testing.assert_array_equal(
            getattr(again.second_order(), matrix), getattr(rig.second_order(), matrix)
        )
    assert again.inputs == rig.inputs
    assert again.outputs == rig.outputs
    assert again.chain == rig.chain


def test_numbers_are_saved_to_the_last_digit(tmp_path):
    """MuJoCo's own writer rounds a mass of π to six digits."""
    rig = Rig.from_xml(oscillator(mass=math.pi, stiffness=math.e, damping=1 / 3))
    rig.with_chain(CHAIN).save(tmp_path / "rig.xml")
    again = Rig.load(tmp_path / "rig.xml")
    assert again.model.body_mass[1] == math.pi
    assert again.second_order().stiffness[0, 0] == math.e
    assert again.second_order().damping[0, 0] == 1 / 3
    assert again.chain == CHAIN
    assert again.chain.actuators[0].corner_hz == math.pi


def test_a_rig_with_instruments_survives_saving(tmp_path):
    rig = Rig.from_xml(oscillator()).connected(outputs=["acc.x", "pos"])
    rig = instruments.instrument(
        rig,
        noise_percent=5.0,
        accelerometer="piezo_100mv_g",
        displacement_sensor="laser_10mm",
        force_sensor="strain_1kn",
        shaker="modal_100n",
        acquisition="logger_16bit",
        sample_rate=51.2,
    )
    rig.save(tmp_path / "rig.xml")
    assert Rig.load(tmp_path / "rig.xml").chain == rig.chain


def test_plain_mujoco_loads_a_saved_rig(tmp_path):
    Rig.from_xml(oscillator()).with_chain(CHAIN).save(tmp_path / "rig.xml")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "rig.xml")).nv == 1


def test_other_custom_content_stays(tmp_path):
    custom = '<custom><text name="note" data="&lt;bolted&gt; &amp; glued"/><numeric name="size" data="1 2"/></custom>'
    rig = Rig.from_xml(oscillator(extra=custom)).with_chain(CHAIN)
    for change in (rig, rig.with_chain(Chain())):
        change.save(tmp_path / "rig.xml")
        root = ET.parse(tmp_path / "rig.xml").getroot()
        assert root.find("custom/text[@name='note']").get("data") == "<bolted> & glued"
        assert root.find("custom/numeric[@name='size']").get("data") == "1 2"
        assert Rig.load(tmp_path / "rig.xml").chain == change.chain


def test_a_chain_is_written_once_and_an_ideal_one_not_at_all(tmp_path):
    rig = Rig.from_xml(oscillator()).with_chain(CHAIN)
    rig.save(tmp_path / "rig.xml")
    again = Rig.load(tmp_path / "rig.xml")
    again.with_chain(Chain(sensors=(Gain("pos", 1.0),))).save(tmp_path / "rig.xml")
    assert (tmp_path / "rig.xml").read_text().count("lab:chain") == 1
    assert Rig.load(tmp_path / "rig.xml").chain.sensors == (Gain("pos", 1.0),)
    again.with_chain(Chain()).save(tmp_path / "rig.xml")
    assert "custom" not in (tmp_path / "rig.xml").read_text()


def test_connected_channels_are_saved(tmp_path):
    Rig.from_xml(oscillator()).connected(inputs=[], outputs=["vel"]).save(tmp_path / "rig.xml")
    again = Rig.load(tmp_path / "rig.xml")
    assert again.inputs == ()
    assert [c.name for c in again.outputs] == ["vel"]


def test_saving_where_nothing_can_be_written(tmp_path):
    rig = Rig.from_xml(oscillator())
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "no" / "rig.xml", tmp_path / "file" / "rig.xml", tmp_path):
        with pytest.raises(FileError, match="cannot write"):
            rig.save(path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


# Refusals.


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        ('<freejoint name="six"/>', "'six' of model 'one' is a free or ball joint; expected slide and hinge"),
        ('<joint name="x" type="slide"/><joint name="three" type="ball"/>', "'three' .* free or ball joint"),
        ('<joint name="x" type="slide" stiffness="1" springyield="0.1"/>', "plastic spring.*hysteresis"),
    ],
)
def test_joints_that_are_refused(joint, message):
    body = f'<body>{joint}<geom size="0.1" mass="1"/></body>'
    with pytest.raises(RigError, match=message) as caught:
        Rig.from_xml(f'<mujoco model="one"><worldbody>{body}</worldbody></mujoco>')
    assert "\n" not in str(caught.value)


def test_delays_of_the_model_itself_are_refused():
    xml = oscillator().replace('<motor name="force"', '<motor name="force" nsample="4" delay="0.004"')
    with pytest.raises(RigError, match=r"delays an actuator.*measurement chain"):
        Rig.from_xml(xml)


def test_nothing_that_moves():
    with pytest.raises(RigError, match="model 'desk' has no joint, so nothing can move"):
        Rig.from_xml('<mujoco model="desk"><worldbody><geom size="1"/></worldbody></mujoco>')


def test_a_chain_for_another_structure_is_refused():
    with pytest.raises(UnknownNameError, match="output channel 'acc9' does not exist"):
        Rig.from_xml(oscillator()).with_chain(Chain(sensors=(Gain("acc9", 1.0),)))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("{", "'lab:chain' is not JSON"),
        ("[1]", "expected a table"),
        ("{&quot;sensor&quot;: 1}", "unknown key 'sensor'"),
    ],
)
def test_a_spoilt_chain_is_refused(data, message):
    with pytest.raises(RigError, match=message):
        Rig.from_xml(oscillator(extra=f'<custom><text name="lab:chain" data="{data}"/></custom>'))
