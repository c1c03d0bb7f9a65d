"""Spectra, their likelihood and its slopes, against what is known of Gaussian signals."""

import numpy as np
import pytest

from identification.recording import Record, Recording
from lab.diagnosis.calibrate import parameters_of
from lab.diagnosis.spectral.ambient import pushed
from lab.diagnosis.spectral.fit import fit, point, slopes, system, whitened_error
from lab.diagnosis.spectral.goodness import goodness
from lab.diagnosis.spectral.lines import averages, bands_for, half_bandwidth, piece_length, pieces_of
from lab.diagnosis.spectral.recorded import Recorded
from lab.diagnosis.spectral.transfer import plant_response
from lab.responder import ready
from lab.rig import Rig
from lab.twin import twin

RATE = 5.0
OUTPUTS = ["acc1.x", "acc2.x", "acc3.x"]


def ambient(rig, n, seed, noise=0.01):
    """Outputs under white forces of 1 N on every mass, by the fast twin, settled, with white noise."""
    rng = np.random.default_rng(seed)
    driven = rig.connected(inputs=["force1", "force2", "force3"], outputs=OUTPUTS)
    y = ready(twin(driven).plant, 1 / RATE).outputs(rng.standard_normal((3, n + 500)), n + 500)[:, 500:]
    y = y + noise * y.std(axis=1, keepdims=True) * rng.standard_normal(y.shape)
    return Recording((Record("ambient", np.zeros((0, n)), y),), (), driven.outputs, RATE)


@pytest.fixture(scope="module")
def rig():
    xml = Rig.load("models/chain3_uncoupled.xml").xml
    Rig.from_xml(xml)
    names = {actuator for actuator in ("force1", "force2", "force3") if f'"{actuator}"' not in xml}
    extra = "".join(f'<motor name="{name}" joint="x{name[-1]}"/>' for name in sorted(names))
    return Rig.from_xml(xml.replace("</actuator>", extra + "</actuator>")).connected(
        inputs=[], outputs=OUTPUTS
    )


def likelihood_of(rig, recording):
    model = twin(rig)
    experiment = Recorded.of(recording, rig, model, band=None)
    return experiment, experiment.likelihood(model, parameters_of(model), rig)


def test_averaged_spectra_are_unbiased(rig):
    recording = ambient(rig, 100_000, 1, noise=0.0)
    plant = pushed(twin(rig), np.eye(3)).plant
    y = [np.asarray(recording.records[0].outputs[:, :])]
    # Below, accelerations without noise fall under what leaks from the resonances.
    bands = bands_for(plant, piece_length(y), 1 / RATE, band=(0.02, 2.5))
    found = averages(pieces_of(y, bands.length), bands)
    H = plant_response(plant, bands.nodes.ravel(), dt=1 / RATE).reshape(2, -1, 3, 3)
    S = 0.5 * (H @ H.conj().swapaxes(2, 3)).sum(axis=0)
    ratio = np.diagonal(found.values, axis1=1, axis2=2).real / np.diagonal(S, axis1=1, axis2=2).real
    z = (ratio - 1) * np.sqrt(found.counts)[:, None]
    # Each has unit variance about zero: the mean of many and their variance within 5 standard deviations.
    assert abs(z.mean()) < 5 / np.sqrt(z.size)
    assert abs(z.var() - 1) < 5 * np.sqrt((2 + 6) / z.size)


def test_bands_never_reach_over_a_resonance(rig):
    plant = twin(rig).plant
    bands = bands_for(plant, 100_000, 1 / RATE)
    width = (bands.last - bands.first + 1) * RATE / 100_000
    assert np.all(bands.last[:-1] + 1 == bands.first[1:])
    assert np.all((width <= half_bandwidth(plant, bands.frequency_hz)) | (bands.first == bands.last))


def test_the_gradient_is_that_of_the_deviance(rig):
    recording = ambient(rig, 4000, 2)
    _, likelihood = likelihood_of(rig, recording)
    rng = np.random.default_rng(3)
    theta, nuisance = rng.standard_normal(likelihood.parameters.n), likelihood.nuisance_mean
    at = point(likelihood, theta, (), nuisance)
    gradient, _ = system(likelihood, at, slopes(likelihood, at), whitened_error(likelihood, at))
    for j in (0, 4, theta.size, theta.size + 4):
        step = np.zeros(gradient.size)
        step[j] = 1e-4
        up, down = (at.moved(likelihood, sign * step).objective for sign in (1, -1))
        # One-sided slopes over 3 % of a prior's width are right to about a percent of the steepest.
        assert 2 * gradient[j] == pytest.approx(
            (up - down) / 2e-4, rel=0.03, abs=2e-3 * np.abs(gradient).max()
        )


def test_whitened_rows_multiply_to_traces(rig):
    recording = ambient(rig, 2000, 4)
    _, likelihood = likelihood_of(rig, recording)
    S = likelihood.predict(np.zeros(likelihood.parameters.n), (), likelihood.nuisance_mean)
    dS = likelihood.nuisance_slopes(np.zeros(likelihood.parameters.n), (), likelihood.nuisance_mean)[[0, 4]]
    dS = np.stack([np.broadcast_to(each, S.shape) for each in dS])
    rows = likelihood.whitened(S, dS)
    inverse = np.linalg.inv(S)
    trace = np.trace(inverse @ dS[0] @ inverse @ dS[1], axis1=-2, axis2=-1).real
    assert rows[0] @ rows[1] == pytest.approx(float(np.sum(likelihood.counts * trace)), rel=1e-8)


def test_a_fit_knows_forces_and_noise_and_how_well(rig):
    z = []
    for seed in range(6):
        _, likelihood = likelihood_of(rig, ambient(rig, 6000, 10 + seed))
        found = fit(likelihood, np.zeros(likelihood.parameters.n), (), likelihood.nuisance_mean)
        spread = np.sqrt(np.diag(found.covariance))
        z.append(found.nuisance[:3] / spread[found.theta.size : found.theta.size + 3])
    # The truth is log 1 = 0; the mean square of 18 standard normals lies below 2.4 but for one chance in a thousand.
    assert np.mean(np.square(z)) < 2.4


def test_goodness_knows_truth_from_error(rig):
    _, likelihood = likelihood_of(rig, ambient(rig, 20_000, 5))
    found = fit(likelihood, np.zeros(likelihood.parameters.n), (), likelihood.nuisance_mean)
    S = likelihood.predict(found.theta, (), found.nuisance)
    assert goodness(likelihood, S).passed
    wrong = S.copy()
    gain = np.array([1.0, 1.1, 1.0])
    wrong = wrong * np.outer(gain, gain)
    left = goodness(likelihood, wrong)
    assert not left.passed
    assert 1 in left.channels


def test_missing_samples_split_the_record():
    y = np.random.default_rng(6).standard_normal((2, 1000))
    y[1, 400:410] = np.nan
    # Two pieces of 400 samples use more than one of 590.
    assert piece_length([y]) == 400
    y[:, 700] = np.nan
    pieces = pieces_of([y], piece_length([y]))
    assert [piece.shape for piece in pieces] == [(2, 290)] * 3
    assert all(np.all(np.isfinite(piece)) for piece in pieces)
