"""The same cause twice at one place, as when an extended model is diagnosed again: both act."""

import numpy as np
import pytest

import lab
from lab import forces
from lab.effects import EFFECTS
from lab.twin import twin
from tests.lab.structures import chain_xml

CASES = {
    "hysteresis": {"stiffness": 50.0, "yield_displacement": 0.01},
    "stiffness_drift": {"relative_change_over_record": 0.1},
    "gap_contact": {"gap": 0.02, "contact_stiffness": 500.0},
    "bilinear_stiffness": {"relative_change_in_extension": 0.2},
}


@pytest.mark.parametrize("cause", CASES)
def test_a_cause_can_strike_twice(cause):
    rig = lab.Rig.from_xml(chain_xml([1.0], [(400.0, 2.0)], {}))
    spring = rig.springs[0].name
    once = EFFECTS[cause](spring, **CASES[cause]).apply(rig)
    again = EFFECTS[cause](spring, **CASES[cause]).apply(once)
    assert len(twin(again).plant.laws) == len(twin(once).plant.laws) + 1


def test_two_hysteretic_forces_are_one_of_twice_the_stiffness():
    rig = lab.Rig.from_xml(chain_xml([1.0], [(400.0, 2.0)], {})).connected(
        inputs=["force0"], outputs=["pos0"]
    )
    spring, force = rig.springs[0].name, lab.EXCITATIONS["random"](rms=5.0)
    kind = EFFECTS["hysteresis"]
    half = kind(spring, stiffness=50.0, yield_displacement=0.01)
    whole = kind(spring, stiffness=100.0, yield_displacement=0.01)
    two, one = (
        lab.simulate(each, force, sample_rate=50.0, duration=4.0, accuracy=1e-6).records[0].outputs
        for each in (half.apply(half.apply(rig)), whole.apply(rig))
    )
    # Both simulations are asked for 1e-6 of the signal.
    np.testing.assert_allclose(two, one, atol=1e-5 * np.max(np.abs(one)))
    laws = [law.kind for law in twin(half.apply(half.apply(rig))).plant.laws]
    assert laws == [forces.BOUC_WEN] * 2
