"""Parameters that no data reach and scales that no data tell are said, and disappear when the data reach them."""

from dataclasses import replace

import numpy as np
import pytest

from lab.diagnosis.fit import Fit, fit
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.noise import noise_of
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.unlearnable import unlearnable
from lab.excitation import Random
from lab.instruments import instrument
from lab.rig import Rig
from lab.simulate import simulate
from lab.twin import twin

NOISE = 1.0


def fitted(outputs, widths) -> tuple[Misfit, Fit]:
    rig = Rig.load("models/chain3_coupled.xml").connected(inputs=["force1", "force2"], outputs=outputs)
    recording = simulate(
        instrument(rig, noise_percent=NOISE), Random(rms=1.0), sample_rate=5.0, duration=200.0, seed=1
    )
    model = twin(rig)
    names = [f"mass {b}" for b in model.bodies]
    names += [f"{group} {s}" for group in ("stiffness", "damping") for s in model.springs]
    values = np.array([widths[name.split(" ")[0]] for name in names])
    sizes = len(model.bodies), len(model.springs)
    parameters = Parameters(tuple(names), values, *sizes, np.eye(len(names)))
    misfit = Misfit.of(recording, model, parameters)
    return misfit, fit(misfit, np.zeros(len(names)), iterations=3), recording


ALL = ["acc1.x", "acc2.x", "acc3.x"]
LOOSE = {"mass": 0.02, "stiffness": 0.05, "damping": 0.5}


def test_every_common_scale_is_said_and_nothing_else():
    misfit, found, _ = fitted(ALL, LOOSE)
    forces, sensors = unlearnable(misfit, found)
    assert "cannot be told from one on the gain of force1 and force2" in forces
    assert "gain of all sensors, acc1.x, acc2.x and acc3.x" in sensors


def test_parameters_with_a_prior_tighter_than_the_data_stay_there():
    # A mass is known to some 1e-3 from 700 samples with 1 % of noise: a prior of 1e-5 leaves nothing to learn.
    misfit, found, _ = fitted(ALL, {**LOOSE, "mass": 1e-5})
    (masses, *_) = unlearnable(misfit, found)
    assert masses.startswith("the mass of every body cannot be learned from these data")
    assert not any(text.startswith(("the stiffness", "the damping")) for text in unlearnable(misfit, found))


def test_a_known_stop_sets_the_scale():
    """A friction force in newtons is no factor of anything: the common scale shows."""
    misfit, found, _ = fitted(ALL, LOOSE)
    from lab import forces as kinds

    held = misfit.twin.plant.with_law(kinds.COULOMB, misfit.twin.rows[3], 0.2, 0.0)
    rubbing = replace(misfit, twin=replace(misfit.twin, plant=held))
    said = unlearnable(rubbing, found)
    assert not any("common factor" in text and "force1" in text for text in said)


def test_the_noise_of_every_channel_is_measured():
    _, found, recording = fitted(ALL, LOOSE)
    for (name, noise), y in zip(
        noise_of(found.residual, recording).items(), recording.records[0].outputs[:, :], strict=True
    ):
        # Noise of 1 % of each output's RMS; 4.5 standard deviations of its estimate.
        assert noise.value == pytest.approx(NOISE / 100 * np.std(y), abs=4.5 * noise.std)
        assert noise.std == pytest.approx(noise.value / np.sqrt(2 * found.residual.shape[1]))
        assert (name, noise.unit) in {(c.name, c.unit) for c in recording.outputs}
