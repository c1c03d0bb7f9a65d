"""A fit ends where the posterior is flat, also where some of its parameters hardly matter at first."""

import numpy as np
import pytest

from lab.diagnosis.calibrate import calibrate, parameters_of
from lab.diagnosis.conclude import calibrated_rig
from lab.diagnosis.fit import theta_slopes, weights
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.parameters import Parameters
from lab.effects.stiffness_change import StiffnessChange
from lab.excitation import Random
from lab.instruments import instrument
from lab.responder import NO_OBSERVER
from lab.rig import Rig
from lab.simulate import simulate
from lab.twin import twin

INPUTS = ["force_v1", "force_u2", "force_u3", "force_v4"]
OUTPUTS = ["acc1.x", "acc1.z", "acc2.z", "acc3.z", "acc4.x"]


def to_gain(misfit, found):
    """What the quadratic at the end of a fit still promises in -2 log posterior."""
    J = theta_slopes(misfit, found.theta, (), NO_OBSERVER, found.residual, None)
    J = (J * weights(found.residual)[:, None]).reshape(found.theta.size, -1)
    e = (found.residual * weights(found.residual)[:, None]).ravel()
    g = J @ e + found.precision @ found.theta
    return float(g @ np.linalg.solve(J @ J.T + found.precision, g))


@pytest.fixture(scope="module")
def off_and_misfit():
    rig = Rig.load("models/truss.xml").connected(inputs=INPUTS, outputs=OUTPUTS)
    model = twin(rig)
    parameters = parameters_of(model)
    off = calibrated_rig(
        Misfit(model, parameters, (), 0.05, ()), np.random.default_rng(0).standard_normal(parameters.n), rig
    )
    recording = simulate(
        instrument(StiffnessChange("bar2_4", relative_change=-0.15).apply(rig), noise_percent=1.0),
        Random(rms=100.0),
        sample_rate=20.0,
        duration=1000.0,
        seed=0,
    )
    model = twin(off)
    return off, Misfit.of(recording, model, parameters_of(model))


@pytest.mark.slow
def test_a_fit_ends_where_nothing_is_to_gain(off_and_misfit):
    off, misfit = off_and_misfit
    found = calibrate(misfit, off).fit
    # It stops when an iteration gains less than 0.5.
    assert to_gain(misfit, found) < 0.5


def test_no_step_is_longer_than_a_line_is_good_for():
    parameters = Parameters(("mass a", "damping b"), np.array([0.01, 0.25]), 1, 0, np.eye(2), inputs=(0,))
    assert parameters.allowed(np.array([1.0, 2.0])) == 1
    assert parameters.allowed(np.array([1.0, -8.0])) == pytest.approx(0.5, rel=1e-12)
