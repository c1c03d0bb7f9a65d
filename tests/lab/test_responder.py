"""Responder: exact where a plant is linear, of second order where it is not."""

import numpy as np
import pytest
import scipy.linalg

from lab.effects import EFFECTS
from lab.responder import ready
from lab.twin import twin
from tests.lab.effects import reference
from tests.lab.effects.reference import DT, forces, held, linear, local, nominal, system


def pushes(n=80, seed=0):
    return np.random.default_rng(seed).standard_normal((2, n))


def error(found, truth):
    return np.max(np.max(np.abs(found - truth), axis=1) / np.max(np.abs(truth), axis=1))


def test_a_linear_plant_is_exact():
    u = pushes()
    # Rounding of 80 matrix products.
    assert error(ready(twin(nominal()).plant, DT).outputs(u, 80), linear(u)) < 1e-12


def test_substeps_change_nothing_where_there_is_no_law():
    plant, u = twin(nominal()).plant, pushes()
    np.testing.assert_array_equal(
        ready(plant, DT, substeps=9).outputs(u, 80), ready(plant, DT).outputs(u, 80)
    )


def test_free_decay_from_a_start():
    start = np.array([0.1, 0.0, -0.2, 0.0, 0.3, 0.0])
    A, _, C, _ = system()
    truth = np.stack([C @ scipy.linalg.expm(A * k * DT) @ start for k in range(50)], axis=1)
    found = ready(twin(nominal()).plant, DT).outputs(np.zeros((0, 50)), 50, initial=start)
    assert error(found, truth) < 1e-12


@pytest.mark.parametrize("cause", ["sensor_delay", "actuator_delay"])
def test_delays_add_up(cause):
    place = "acc0.x" if cause == "sensor_delay" else "force0"
    twice, once = nominal(), EFFECTS[cause](place, delay=1.5 * DT).apply(nominal())
    for delay in (0.6 * DT, 0.9 * DT):
        twice = EFFECTS[cause](place, delay=delay).apply(twice)
    a, b = (ready(twin(rig).plant, DT).outputs(pushes(), 80) for rig in (twice, once))
    assert error(a, b) < 1e-12


def test_a_late_force_through_a_lag_to_a_late_lagging_sensor():
    """Everything at once, against the same system with the delays made whole by finer samples."""
    rig = nominal()
    for effect in (
        EFFECTS["actuator_delay"]("force0", delay=0.75 * DT),
        EFFECTS["actuator_lag"]("force0", time_constant=0.05),
        EFFECTS["sensor_delay"]("acc0.x", delay=1.5 * DT),
        EFFECTS["sensor_lag"]("acc0.x", corner_hz=3.0),
    ):
        rig = effect.apply(rig)
    u = pushes()
    found = ready(twin(rig).plant, DT).outputs(u, 80)
    # At a quarter of the sample time, delays are 3 and 6 samples.
    fine = np.repeat(u, 4, axis=1)
    truth = ready(twin(rig).plant, DT / 4).outputs(fine, 320)[:, ::4]
    assert error(found, truth) < 1e-11


@pytest.mark.parametrize(("substeps", "bound"), [(6, 1e-3), (24, 1e-4)])
def test_a_law_read_late(monkeypatch, substeps, bound):
    rig = EFFECTS["cubic_stiffness"]("spring0_1", k3=4000.0).apply(nominal())
    late = EFFECTS["sensor_delay"]("acc0.x", delay=1.5 * DT).apply(rig)
    u = pushes()
    monkeypatch.setattr(reference, "DT", DT / 2)
    fine = local(np.repeat(u, 2, axis=1), lambda s, x, v, z: (4000 * x**3, 0.0))
    truth = np.concatenate([np.zeros(3), fine[0]])[: 2 * 80 : 2]
    found = ready(twin(late).plant, DT, substeps=substeps).outputs(u, 80)[0]
    # Second order in the substep, read at the start of one.
    assert np.max(np.abs(found - truth)) < bound * np.max(np.abs(truth))


def test_forces_at_rest_and_on_all_masses_agree():
    u = pushes()
    np.testing.assert_allclose(held(*system(), forces(u)), linear(u), rtol=0, atol=1e-13)
