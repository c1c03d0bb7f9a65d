"""The frequency response of a plant is the transform of its impulse response, whatever its paths do."""

from dataclasses import replace

import numpy as np
import pytest

from lab import forces
from lab.diagnosis.spectral.transfer import at_time, drifts, plant_response
from lab.plant import Tone
from lab.responder import ready
from lab.rig import Rig
from lab.twin import twin

DT = 0.02
FREQUENCY = np.array([0.5, 1.7, 3.3, 20.0])


@pytest.fixture(scope="module")
def plant():
    rig = Rig.load("models/chain7.xml")
    rig = rig.connected(inputs=["force1", "force3"], outputs=["acc1.x", "pos2", "acc7.x"])
    plant = twin(rig).plant
    plant = plant.with_output(0, gain=1.3, delay=1.3 * DT, lag=0.01).with_output(1, delay=2 * DT)
    plant = plant.with_input(0, delay=0.4 * DT, held_lag=0.03)
    return replace(plant.with_input(1, lag=0.02, gain=-0.7, delay=1.6 * DT), order=(2, 1, 0))


@pytest.mark.parametrize("column", [0, 1])
def test_it_is_the_transform_of_the_impulse_response(plant, column):
    n = 1 << 14
    pulse = np.zeros((2, n))
    pulse[column, 0] = 1.0
    y = ready(plant, DT).outputs(pulse, n)
    transform = y @ np.exp(-2j * np.pi * np.outer(np.arange(n) * DT, FREQUENCY))
    H = plant_response(plant, FREQUENCY, dt=DT)[:, :, column]
    # After 328 s the slowest mode, 0.055 /s, has decayed to 1e-8.
    assert np.abs(transform.T - H).max() < 1e-7 * np.abs(H).max()


def test_forces_of_tones_come_behind_the_inputs(plant):
    row = plant.forces[:, 1]
    bare = replace(plant, input_paths=(plant.input_paths[0], type(plant.input_paths[0])()))
    H = plant_response(replace(bare, tones=(Tone(row, 1.0, 0.0, 0.0),)), FREQUENCY, dt=DT)
    assert H.shape == (4, 3, 3)
    # The same force through another column: rounding only.
    np.testing.assert_allclose(H[:, :, 2], H[:, :, 1], rtol=1e-10)


def test_a_structure_without_a_basis_of_modes_is_solved_directly(plant):
    # A free mass without springs has two equal poles with one eigenvector.
    ideal = type(plant.output_paths[0])()
    free = replace(plant, stiffness=0 * plant.stiffness, damping=0 * plant.damping, order=())
    free = replace(free, input_paths=(ideal,) * 2, output_paths=(ideal,) * 3)
    H = plant_response(free, FREQUENCY, dt=DT)
    z = np.exp(2j * np.pi * FREQUENCY * DT)
    # Position under a held force of 1 N on 1 kg, exact: dt²/2 (z + 1) / (z - 1)².
    other = replace(free, displacement=np.eye(7)[[0, 1, 2]], acceleration=np.zeros((3, 7)))
    G = plant_response(other, FREQUENCY, dt=DT)
    np.testing.assert_allclose(G[:, 0, 0], DT**2 / 2 * (z + 1) / (z - 1) ** 2, rtol=1e-9)
    np.testing.assert_allclose(H[:, 0, 0], 1.0, rtol=1e-9)


def test_a_drifting_spring_has_the_stiffness_of_the_time(plant):
    row = np.eye(7)[0]
    drifting = plant.with_law(forces.DRIFT, row, 100.0)
    assert drifts(drifting)
    assert not drifts(at_time(drifting, 0.5))
    assert at_time(drifting, 0.5).stiffness[0, 0] == plant.stiffness[0, 0] + 50.0
