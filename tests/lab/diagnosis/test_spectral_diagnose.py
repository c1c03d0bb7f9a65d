"""Causes hidden in ambient recordings by MuJoCo, and in frequency responses, are found; clean ones are consistent."""

import numpy as np
import pytest

from identification.recording import Record, Recording
from identification.response import FrequencyResponse
from lab.diagnosis.diagnose import diagnose
from lab.diagnosis.outcome import CONSISTENT, EXPLAINED
from lab.diagnosis.spectral.diagnose import diagnose_spectra
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
