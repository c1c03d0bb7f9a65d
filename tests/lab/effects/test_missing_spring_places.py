"""Where a spring may be missing: between bodies that move against each other along the line that joins them."""

import numpy as np

from lab.effects.missing_spring import MissingSpring
from lab.rig import Rig
from lab.twin import spring_rows

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
