"""Causes hidden in ambient recordings by MuJoCo, and in frequency responses, are found; clean ones are consistent."""

import numpy as np
import pytest

from identification.recording import Record, Recording
from identification.response import FrequencyResponse
from lab.diagnosis.calibrate import parameters_of
from lab.diagnosis.diagnose import diagnose
from lab.diagnosis.outcome import CONSISTENT, EXPLAINED
from lab.diagnosis.spectral.diagnose import diagnose_spectra, evidence_threshold
from lab.diagnosis.spectral.fit import fit
from lab.diagnosis.spectral.recorded import Recorded
from lab.diagnosis.spectral.search import drifting
from lab.diagnosis.spectral.transfer import plant_response
from lab.effects import EFFECTS
from lab.errors import LabError
from lab.excitation import Ambient
from lab.instruments import instrument
from lab.rig import Rig
from lab.show.diagnosis_report import write_diagnosis_report
from lab.show.rerun_log.diagnosis import write_diagnosis_rrd
from lab.simulate import simulate
from lab.twin import twin

CHAIN = [f"acc{i}.x" for i in range(1, 8)]


@pytest.fixture(scope="module")
def three():
    return Rig.load("models/chain3_coupled.xml").connected(inputs=[], outputs=["acc1.x", "acc2.x", "acc3.x"])


@pytest.fixture(scope="module")
def seven():
    return Rig.load("models/chain7.xml").connected(inputs=[], outputs=CHAIN)


def measured(rig, rate, n, seed):
    """Outputs under white forces on the masses of the model, not on what hangs on them."""
    pushed = Ambient(rms=1.0, dofs=tuple(dof for dof in rig.dofs if dof.startswith("x")))
    return simulate(
        instrument(rig, noise_percent=1.0), pushed, sample_rate=rate, duration=n / rate, seed=seed
    )


def test_a_true_model_is_consistent_and_shown(three, tmp_path):
    recording = measured(three, 5.0, 4000, 1)
    diagnosis = diagnose(recording, three)
    assert (diagnosis.verdict, diagnosis.findings) == (CONSISTENT, ())
    # Scatter alone is left; a few groups of lines know its size to within a factor of two.
    assert diagnosis.errors.calibrated < 2 * diagnosis.errors.noise_floor
    assert any("no force was measured" in warning for warning in diagnosis.warnings)
    write_diagnosis_report(tmp_path / "report.html", diagnosis, recording)
    assert "power spectral densities" in (tmp_path / "report.html").read_text()
    write_diagnosis_rrd(tmp_path / "run.rrd", diagnosis, recording)
    assert (tmp_path / "run.rrd").stat().st_size > 0


def test_a_late_sensor_is_named(three):
    late = EFFECTS["sensor_delay"]("acc2.x", delay=0.3).apply(three)
    diagnosis = diagnose(measured(late, 5.0, 4000, 2), three)
    assert diagnosis.verdict == EXPLAINED
    (finding,) = diagnosis.findings
    assert (finding.effect.cause, finding.effect.location) == ("sensor_delay", "acc2.x")
    # Four standard deviations: one chance in ten thousand.
    delay = finding.parameters["delay"]
    assert abs(delay.value - 0.3) < 4 * delay.std


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cause", "location", "size"),
    [
        ("mass_change", "mass3", {"delta_mass": 0.15}),
        ("sensor_gain", "acc4.x", {"relative_change": -0.1}),
        ("attached_oscillator", "mass6", {"mass": 0.08, "frequency_hz": 9.0, "damping_ratio": 0.02}),
        ("line_hum", "acc3.x", {"frequency_hz": 16.667, "amplitude": 0.5}),
    ],
)
def test_a_cause_hidden_in_a_chain_is_named(seven, cause, location, size):
    rig = EFFECTS[cause](location, **size).apply(seven)
    diagnosis = diagnose(measured(rig, 50.0, 8000, 3), seven)
    assert diagnosis.verdict == EXPLAINED
    finding = diagnosis.findings[0]
    assert (finding.effect.cause, finding.effect.location) == (cause, location)
    for name, value in size.items():
        found = finding.parameters[name]
        assert abs(found.value - value) < 4 * found.std


def responses(rig, noise, seed, dt=0.02):
    """Responses of the rig's twin on 400 lines, with complex white noise relative to their RMS."""
    rng = np.random.default_rng(seed)
    f = 0.05 * np.arange(1, 401)
    H = plant_response(twin(rig).plant, f, dt=dt)
    level = noise * np.sqrt(np.mean(np.abs(H) ** 2, axis=0))
    H = H + level * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)) / np.sqrt(2)
    return FrequencyResponse(f, H, dt, rig.inputs, rig.outputs)


def test_an_added_mass_shows_in_frequency_responses():
    rig = Rig.load("models/chain7.xml").connected(inputs=["force2"], outputs=["acc2.x", "acc5.x", "acc7.x"])
    assert diagnose_spectra(responses(rig, 0.01, 4), rig).verdict == CONSISTENT
    heavy = EFFECTS["mass_change"]("mass5", delta_mass=0.1).apply(rig)
    diagnosis = diagnose_spectra(responses(heavy, 0.01, 5), rig)
    assert diagnosis.verdict == EXPLAINED
    (finding,) = diagnosis.findings
    assert (finding.effect.cause, finding.effect.location) == ("mass_change", "mass5")
    found = finding.parameters["delta_mass"]
    assert abs(found.value - 0.1) < 4 * found.std
    # On lines kept aside, the noise put in is left, known from 120 lines to about 7 %, and the floor's estimate likewise.
    assert diagnosis.errors.extended == pytest.approx(0.01, rel=0.3)


def test_dead_and_broken_channels_are_refused(three):
    y = np.random.default_rng(6).standard_normal((3, 500))
    y[1] = 0.0
    dead = Recording((Record("ambient", np.zeros((0, 500)), y),), (), three.outputs, 5.0)
    with pytest.raises(LabError, match=r"acc2\.x.*never changes"):
        diagnose_spectra(dead, three)
    y[1, ::50] = np.nan
    holes = Recording(
        (Record("ambient", np.zeros((0, 500)), y + 1.0 * np.arange(500) % 7),), (), three.outputs, 5.0
    )
    with pytest.raises(LabError, match="no stretch of 64 samples"):
        diagnose_spectra(holes, three)


@pytest.mark.slow
def test_parts_of_a_record_show_a_spring_that_drifts_although_they_blur_the_lowest_mode(seven):
    drift = EFFECTS["stiffness_drift"]("spring2_3", relative_change_over_record=-0.4)
    model = twin(seven)
    experiment = Recorded.of(measured(drift.apply(seven), 50.0, 4000, 3), seven, model, band=None)
    likelihood = experiment.likelihood(model, parameters_of(model), seven)
    found = fit(likelihood, np.zeros(likelihood.parameters.n), (), likelihood.nuisance_mean)
    parts = experiment.in_parts(experiment.surveyed(likelihood, found.nuisance))
    assert len(parts.data) == 4
    # Each lasts 14 s, and half the bandwidth of the lowest mode is a hundredth of a hertz.
    lowest = seven.second_order().modes().frequency_hz[0]
    assert lowest < parts.band_hz[0] < 5
    (best, *_), places = drifting(parts, found, EFFECTS["stiffness_drift"])
    assert (best.location, places) == ("spring2_3", 7)
    assert best.gain > evidence_threshold(100)
    value, std = best.fit.causes[-1].values[0], np.sqrt(best.fit.covariance[21, 21])
    # Four standard deviations: one chance in ten thousand.
    assert abs(value + 0.4) < 4 * std


@pytest.mark.parametrize(("n", "parts"), [(300, 2), (150, None)])
def test_short_records_have_fewer_parts_or_none(seven, n, parts):
    model = twin(seven)
    experiment = Recorded.of(measured(seven, 50.0, n, 3), seven, model, band=None)
    found = experiment.in_parts(experiment.likelihood(model, parameters_of(model), seven))
    assert (found and len(found.data)) == parts
    if found:
        # What a tone taken out changes, it changes at the same lines.
        assert experiment.again(found).band_hz == found.band_hz
