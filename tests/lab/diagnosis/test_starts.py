"""Starts: what has been added to a structure moves along with what it is tied to."""

import numpy as np

from lab.diagnosis.starts import motions_of
from lab.effects import EFFECTS
from lab.rig import Rig

START = np.array([0.1, -0.2, 0.3, 1.0, 2.0, 3.0])


def test_an_oscillator_moves_along_with_its_body_and_rest_stays_rest():
    model = Rig.load("models/chain3_coupled.xml")
    rig = EFFECTS["attached_oscillator"]("mass2", mass=0.1, frequency_hz=2.0, damping_ratio=0.05).apply(model)
    rest, motion = motions_of(rig, model.dofs, (None, START))
    assert rest is None
    known = [rig.dofs.index(name) for name in model.dofs]
    (extra,) = set(range(len(rig.dofs))) - set(known)
    np.testing.assert_array_equal(np.array(motion)[:, known], START.reshape(2, 3))
    # Its joint counts from the body that it sits on.
    np.testing.assert_array_equal(np.array(motion)[:, extra], 0.0)


def test_what_springs_hold_goes_where_they_carry_it():
    rig = Rig.load("models/chain3_coupled.xml")
    ((q, v),) = motions_of(rig, rig.dofs[:2], (START[[0, 1, 3, 4]],))
    np.testing.assert_array_equal((q[:2], v[:2]), START.reshape(2, 3)[:, :2])
    K = rig.second_order().stiffness
    # Nothing pushes it on: all its forces are in balance.
    assert np.max(np.abs([K[2] @ q, K[2] @ v])) < 1e-12 * np.max(np.abs(K)) * 3.0
    assert min(abs(q[2]), abs(v[2])) > 1e-3
