"""Where a spring may be missing: between bodies that move against each other along the line that joins them."""

from types import SimpleNamespace

import numpy as np
import pytest

from lab.effects.missing_spring import MissingSpring
from lab.files.model import load_model
from lab.rig import Rig
from lab.twin import spring_rows, twin

CHAIN = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="a"><joint name="h1" type="hinge" axis="0 -1 0" stiffness="1"/><geom size="0.1" mass="1"/>
      <body name="b" pos="1 0 {z}"><joint name="h2" type="hinge" axis="0 -1 0" stiffness="1"/><geom size="0.1" mass="1"/>
        <body name="nut" pos="0.5 0 0"><geom size="0.1" mass="0.1"/></body>
        <body name="c" pos="1 0 0"><joint name="h3" type="hinge" axis="0 -1 0" stiffness="1"/><geom size="0.1" mass="1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_no_spring_along_a_straight_beam():
    assert MissingSpring.places(Rig.from_xml(CHAIN.format(z=0))) == ()


def test_a_spring_across_a_bend_is_one():
    rig = Rig.from_xml(CHAIN.format(z=1))
    places = MissingSpring.places(rig)
    # The bend is at b: what lies behind it moves against a, and the pieces behind it lie on one line.
    assert places == ("a|nut", "a|c")
    for place in places:
        assert np.any(np.abs(spring_rows(MissingSpring(place, 1.0).apply(rig))[-1]) > 0.1)


@pytest.mark.parametrize("name", ["chain7", "bent"])
def test_the_extension_assumed_is_that_of_the_spring_in_mujoco(name):
    rig = Rig.from_xml(CHAIN.format(z=1)) if name == "bent" else load_model(name)
    plant, survey = twin(rig).plant, SimpleNamespace(rig=rig)
    places = MissingSpring.places(rig)
    assert places
    for place in places:
        spring = MissingSpring(place, 2.0)
        row = spring_rows(spring.apply(rig))[-1]
        added = spring.explain(plant, survey).stiffness - plant.stiffness
        # Both are the same derivative at the same place, by two ways of rounding.
        assert added == pytest.approx(2.0 * np.outer(row, row), abs=1e-12)
