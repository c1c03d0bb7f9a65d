"""What bends and kinks, and the structure without its kinks."""

import numpy as np
import pytest

from lab import tangent
from lab.rig import Rig
from tests.lab.structures import LINEAR, model, oscillator

PLAIN = oscillator()
GAP = """<tendon><fixed name="gap" stiffness="30" springlength="{low} {high}"><joint joint="x" coef="1"/></fixed></tendon>"""


def with_gap(low, high):
    return oscillator(extra=GAP.format(low=low, high=high))


KINKS = {
    "deadband": with_gap(-0.1, 0.1),
    "dry friction": PLAIN.replace('damping="0.4"', 'damping="0.4" frictionloss="0.1"'),
    "joint limit": PLAIN.replace('damping="0.4"', 'damping="0.4" range="-1 1"'),
    "clipped control": PLAIN.replace('<motor name="force"', '<motor name="force" ctrlrange="-1 1"'),
    "clipped force": PLAIN.replace('<motor name="force"', '<motor name="force" forcerange="-1 1"'),
    "clipped sensor": PLAIN.replace('<jointpos name="pos"', '<jointpos name="pos" cutoff="0.1"'),
    "contact": PLAIN.replace('<flag contact="disable"/>', "").replace(
        "<worldbody>", '<worldbody><geom type="plane" size="1 1 1" pos="0 0 -1"/>'
    ),
}
BENDS = {
    "hinge": PLAIN.replace('type="slide"', 'type="hinge"'),
    "cubic spring": PLAIN.replace('stiffness="50.0"', 'stiffness="50 0 7"'),
    "quadratic damper": PLAIN.replace('damping="0.4"', 'damping="0.4 1 0"'),
    "spatial tendon": oscillator(
        extra='<tendon><spatial stiffness="3"><site site="top"/><site site="wall"/></spatial></tendon>'
    ).replace("<worldbody>", '<worldbody><site name="wall" pos="1 1 0"/>'),
    "air": PLAIN.replace('gravity="0 0 0"', 'gravity="0 0 0" density="1.2"'),
    "springs switched off": PLAIN.replace('contact="disable"', 'contact="disable" spring="disable"'),
    "damper actuator": PLAIN.replace(
        '<motor name="force" joint="x"/>', '<damper name="force" joint="x" kv="2" ctrlrange="0 1"/>'
    ),
}


@pytest.mark.parametrize("name", [*LINEAR, "truss_spatial"])
def test_models_are_smooth(name):
    rig = model(name)
    assert rig.smooth
    assert rig.linear == (name in LINEAR)


@pytest.mark.parametrize("name", KINKS)
def test_kinks_are_noticed(name):
    rig = Rig.from_xml(KINKS[name])
    assert not rig.smooth
    assert not rig.linear
    assert tangent.is_straight(rig.model)


@pytest.mark.parametrize("name", BENDS)
def test_bends_are_noticed(name):
    rig = Rig.from_xml(BENDS[name])
    assert not rig.linear
    assert not tangent.is_straight(rig.model)


def test_the_plain_oscillator_has_neither():
    assert Rig.from_xml(PLAIN).linear


@pytest.mark.parametrize("name", KINKS)
def test_small_motion_feels_no_kink(name):
    """Each kink lies away from rest, so that M, C, K and the state space are those of the plain oscillator."""
    plain, kinked = Rig.from_xml(PLAIN), Rig.from_xml(KINKS[name])
    for matrix in ("mass", "damping", "stiffness"):
        expected = getattr(plain.second_order(), matrix)
        # One number, put together in the same order: equal to the last bit.
        np.testing.assert_array_equal(getattr(kinked.second_order(), matrix), expected)
    for letter in "ABCD":
        expected = getattr(plain.state_space(), letter)
        np.testing.assert_allclose(getattr(kinked.state_space(), letter), expected, rtol=1e-14, atol=0)


@pytest.mark.parametrize(
    ("low", "high", "stiffness"),
    [
        (-0.1, 0.1, 50.0),  # at rest inside the gap
        (0.0, 0.1, 50.0 + 15.0),  # touching: half of the spring, the mean of both sides
        (-1e6, 0.0, 50.0 + 15.0),  # a spring that pushes on one side only
        (
            -0.2,
            -0.1,
            50.0 + 30.0,
        ),  # past the gap: pressed against the spring, with equal stiffness on both sides
    ],
)
def test_stiffness_at_a_gap(low, high, stiffness):
    rig = Rig.from_xml(with_gap(low, high))
    np.testing.assert_allclose(rig.second_order().stiffness, [[stiffness]], rtol=1e-12)
    np.testing.assert_allclose(-2.0 * rig.state_space().A[1, 0], stiffness, rtol=1e-12)


def test_position_of_rest_past_a_gap():
    # 50 x + 30 (x + 0.1) = 0.
    rig = Rig.from_xml(with_gap(-0.2, -0.1))
    np.testing.assert_allclose(rig.operating_point, [-30 * 0.1 / 80], rtol=1e-12)


def test_one_sided_control_has_its_full_gain():
    """A control that cannot be negative stands at its limit; its gain is not the half that clipping would show."""
    rig = Rig.from_xml(PLAIN.replace('<motor name="force"', '<motor name="force" ctrlrange="0 1"'))
    np.testing.assert_allclose(rig.state_space().B[:, 0], [0, 0.5], rtol=1e-14)


def test_the_model_itself_stays_as_it_is():
    rig = Rig.from_xml(KINKS["clipped sensor"])
    copy = tangent.tangent(rig.model, rig.operating_point)
    assert rig.model.sensor_cutoff[0] == 0.1
    assert copy.sensor_cutoff[0] == 0.0
    assert tangent.is_smooth(tangent.tangent(Rig.from_xml(KINKS["deadband"]).model, np.zeros(1)))
