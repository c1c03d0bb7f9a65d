"""A force known only up to a factor: within its width the factor is calibrated, and no cause is made of it."""

import numpy as np
import pytest

import lab
from lab.diagnosis.calibrate import parameters_of
from lab.diagnosis.fit import fit
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.outcome import CONSISTENT, EXPLAINED
from lab.diagnosis.spectral.diagnose import diagnose_spectra
from lab.effects.actuator_gain import ActuatorGain
from lab.effects.mass_change import MassChange
from lab.errors import LabError
from lab.excitation import Random
from lab.instruments import instrument
from lab.rig import Rig
from lab.simulate import simulate
from lab.twin import twin

TRUE = 1.15


@pytest.fixture(scope="module")
def rig():
    inputs, outputs = ["force1", "force2"], ["acc1.x", "acc2.x", "acc3.x"]
    return Rig.load("models/chain3_coupled.xml").connected(inputs=inputs, outputs=outputs)


@pytest.fixture(scope="module")
def recording(rig):
    stronger = ActuatorGain("force2", relative_change=TRUE - 1).apply(rig)
    return simulate(
        instrument(stronger, noise_percent=1.0), Random(rms=1.0), sample_rate=5.0, duration=200.0, seed=3
    )


def test_only_inputs_with_a_width_have_a_gain(rig):
    model = twin(rig)
    assert not parameters_of(model).inputs
    one = parameters_of(model, {"gain force2": 0.1})
    assert (one.inputs, one.names[-1], one.widths[-1]) == ((1,), "gain force2", 0.1)
    both = parameters_of(model, {"gain": 0.14})
    assert both.inputs == (0, 1)
    assert both.n_factors == both.n_structural + 2
    assert both.gains(np.zeros(both.n)) == pytest.approx([1, 1], rel=1e-15)


def test_a_gain_is_calibrated_within_its_error_bar(rig, recording):
    model = twin(rig)
    misfit = Misfit.of(recording, model, parameters_of(model, {"gain force2": 0.14}))
    found = fit(misfit, np.zeros(misfit.parameters.n), iterations=10)
    (gain,) = misfit.parameters.gains(found.theta)
    std = gain * 0.14 * np.sqrt(found.covariance[-1, -1])
    # Four standard deviations, which the noise of two readings of 1 % makes small.
    assert abs(gain - TRUE) < 4 * std
    assert std < 0.01


def test_spectra_have_no_gains(rig, recording):
    with pytest.raises(LabError, match="'gain force2', and the data are spectra; expected"):
        diagnose_spectra(recording, rig, widths={"gain": 0.14})


@pytest.mark.slow
def test_no_cause_is_made_of_what_a_width_covers(rig, recording):
    covered = lab.diagnose(recording, rig, widths={"gain": 0.14})
    assert covered.verdict == CONSISTENT
    told = covered.calibration["gain force2"]
    assert abs(told.value - TRUE) < 4 * told.std
    assert told.nominal == 1
    # The extended model pushes as strongly.
    assert covered.errors.extended < 1.2 * covered.errors.noise_floor
    known = lab.diagnose(recording, rig)
    assert known.verdict == EXPLAINED
    assert [(f.effect.cause, f.effect.location) for f in known.findings] == [("actuator_gain", "force2")]


@pytest.mark.slow
def test_a_change_beside_a_baseline_is_told_whatever_the_gain(rig, recording):
    stronger = ActuatorGain("force2", relative_change=TRUE - 1).apply(rig)
    loaded = MassChange("mass2", delta_mass=0.3).apply(stronger)
    after = simulate(
        instrument(loaded, noise_percent=1.0), Random(rms=1.0), sample_rate=5.0, duration=200.0, seed=5
    )
    open_ = {"mass": 0.1, "stiffness": 0.1, "gain": 0.14}
    diagnosis = lab.diagnose(after, rig, baseline=recording, widths=open_)
    assert diagnosis.verdict == EXPLAINED
    (finding,) = diagnosis.findings
    assert (finding.effect.cause, finding.effect.location) == ("mass_change", "mass2")
    # Both gains are known up to one factor at best, and so is the mass.
    shared = [warning for warning in diagnosis.warnings if "stays what the baseline made of it" in warning]
    assert len(shared) == 2
    mass = diagnosis.calibration["mass mass2"]
    assert mass.value / mass.nominal == pytest.approx(2.3 / 2.0, abs=4 * mass.std / mass.nominal)
