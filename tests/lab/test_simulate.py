"""Simulated tests of every kind against exact responses; settings that make no sense."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg

import lab
from lab.bench import DRIVE
from lab.errors import DivergedError, FileError, LabError
from lab.excitation import Ambient, FreeDecay, Impact, Pulse, Random
from lab.loads import Sampling
from lab.rig import Rig
from lab.simulate import motion, simulate_to_file
from tests.lab.oscillating import ONE, WHITE, lagged_response, one, run
from tests.lab.structures import (
    LINEAR,
    chain_xml,
    held_response,
    moving,
    on_dofs,
    oscillator,
    true_error,
)


@pytest.mark.parametrize("name", LINEAR)
def test_unit_pulses_give_markov_parameters(name):
    """Record j is column j of D, CB, CAB, …: the sampled model's own, from one matrix exponential."""
    rate, rig = LINEAR[name][0], moving(name)
    rig = rig.connected(inputs=[rig.inputs[1].name, rig.inputs[0].name])
    recording = run(rig, Pulse(), sample_rate=rate, duration=40 / rate)
    continuous = rig.state_space()
    n, m = continuous.B.shape
    block = np.zeros((n + m, n + m))
    block[:n] = np.hstack([continuous.A, continuous.B])
    step = scipy.linalg.expm(block / rate)
    A, B = step[:n, :n], step[:n, n:]
    for j, record in enumerate(recording.records):
        expected = [continuous.D[:, j]]
        x = B[:, j]
        for _ in range(39):
            expected.append(continuous.C @ x)
            x = A @ x
        expected = np.array(expected).T
        largest = np.max(np.abs(expected), axis=1)
        assert np.all(np.max(np.abs(record.outputs - expected), axis=1) <= 1e-9 * largest)
        # The first sample of an accelerometer is D itself: the force acts at once.
        np.testing.assert_allclose(record.outputs[:, 0], continuous.D[:, j], rtol=1e-12, atol=1e-15)


def test_impact_carries_its_momentum_into_the_structure():
    recording = run(one(), Impact(100.0, 1e-4, 0.05), accuracy=1e-10)
    _, v, _ = recording.records[0].outputs
    # One sample after a blow of 2 A w / π that was spread over one sample of 0.05 s.
    momentum = 2 * 100 * 1e-4 / math.pi
    exact = held_response(ONE, recording.outputs, 0.05, np.array([[0, momentum / 0.05, 0]]))
    assert v[2] == pytest.approx(exact[1, 2], rel=1e-9)
    assert np.sum(recording.records[0].inputs) * 0.05 == pytest.approx(momentum, rel=1e-12)


def test_ambient_response_is_that_to_the_unmeasured_forces():
    rate, structure = LINEAR["chain3_coupled"]
    rig, drive = moving("chain3_coupled"), Ambient(rms=3.0, dofs=("x1", "x3"))
    recording = run(rig, drive, seed=5)
    record = recording.records[0]
    assert record.kind == "ambient"
    assert record.inputs.shape == (0, 200)
    (again,) = drive.loads(rig, Sampling(rate, 200), np.random.default_rng([5, DRIVE]))
    ((_, forces),) = again.blocks()
    exact = held_response(structure, recording.outputs, 1 / rate, forces)
    errors = np.max(np.abs(record.outputs - exact), axis=1) / np.max(np.abs(exact), axis=1)
    assert np.max(errors) <= 1e-9


def test_free_decay_from_displacement_and_velocity():
    rate, structure = LINEAR["chain3_coupled"]
    rig = moving("chain3_coupled")
    recording = run(rig, FreeDecay({"x1": 0.1, "x3": -0.3}, {"x2": 0.7}))
    record = recording.records[0]
    assert record.kind == "free_decay"
    assert record.inputs.shape[0] == 0
    start = (np.array([0.1, 0, -0.3]), np.array([0, 0.7, 0]))
    exact = held_response(structure, recording.outputs, 1 / rate, np.zeros((3, 200)), start)
    errors = np.max(np.abs(record.outputs - exact), axis=1) / np.max(np.abs(exact), axis=1)
    assert np.max(errors) <= 1e-9
    np.testing.assert_array_equal(record.outputs[3:6, 0], start[0])


def test_geared_motors_and_sensors_mounted_backwards():
    """Factors of channels carry through: the exact response is formed from them alone."""
    xml = oscillator().replace('<motor name="force" joint="x"/>', '<motor name="force" joint="x" gear="-3"/>')
    xml = xml.replace('<site name="top"/>', '<site name="top" euler="0 0 180"/>')
    rig = Rig.from_xml(xml)
    rig = rig.connected(outputs=rig.responding)
    assert [c.factor for c in (*rig.inputs, *rig.outputs)] == [-3.0, 1.0, 1.0, -1.0]
    assert true_error(run(rig, WHITE), ONE) <= 1e-9


def test_servo_as_a_spring_that_is_driven():
    """Base motion: a position servo of gain k pulls the mass with a spring whose other end moves by u."""
    rig = Rig.from_xml(
        oscillator().replace('<motor name="force" joint="x"/>', '<position name="base" joint="x" kp="30"/>')
    )
    rig = rig.connected(outputs=["pos", "vel", "acc.x"])
    structure = dataclasses.replace(ONE, stiffness=[[80.0]])
    assert true_error(run(rig, WHITE), structure) <= 1e-9


def test_gravity_shifts_the_rest_and_nothing_else():
    hanging = Rig.from_xml(oscillator().replace('gravity="0 0 0"', 'gravity="9.81 0 0"'))
    hanging = hanging.connected(outputs=["pos", "vel", "acc.x"])
    assert true_error(run(hanging, WHITE), ONE) <= 1e-9


@pytest.mark.parametrize("kind", ["filter", "filterexact"])
def test_lagging_actuator_of_the_model_itself(kind):
    """A first-order lag before the force, exact as one more state."""
    motor = f'<general name="force" joint="x" dyntype="{kind}" dynprm="0.2" gainprm="3"/>'
    rig = one()
    rig = Rig.from_xml(rig.xml.replace('<motor name="force" joint="x"/>', motor)).connected(
        outputs=["pos", "acc.x"]
    )
    recording = run(rig, WHITE)
    exact = lagged_response(recording, 0.2, gain=3.0)
    assert (
        np.max(np.abs(recording.records[0].outputs - exact) / np.max(np.abs(exact), axis=1, keepdims=True))
        <= 1e-9
    )


def test_duffing_oscillator_against_another_integrator():
    """A hardening spring under held forces, by scipy's eighth-order method, sample by sample."""
    rig = Rig.from_xml(oscillator().replace('stiffness="50.0"', 'stiffness="50 0 300"'))
    rig = rig.connected(outputs=["pos", "vel", "acc.x"])
    recording = run(rig, Random(rms=20.0), duration=5.0)
    state, exact = np.zeros(2), []
    for u in recording.records[0].inputs[0]:

        def law(t, s, u=u):
            return [s[1], (u - 0.4 * s[1] - 50 * s[0] - 300 * s[0] ** 3) / 2]

        exact.append([*state, law(0, state)[1]])
        state = scipy.integrate.solve_ivp(law, (0, 0.05), state, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    exact = np.array(exact).T
    errors = np.max(np.abs(recording.records[0].outputs - exact), axis=1) / np.max(np.abs(exact), axis=1)
    # 1e-9 of ours, and what is left of scipy's 1e-13 per sample.
    assert np.max(errors) <= 1.1e-9
    assert np.max(np.abs(exact[0])) > 0.3


UNSTABLE = chain_xml([1.0, 1.0], [(10.0, 0.1), (-40.0, 0.0)], {})


def test_divergence_leaves_neither_log_nor_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig = Rig.from_xml(UNSTABLE)
    for attempt in (
        lambda: run(rig, WHITE, duration=30.0, accuracy=1e-3),
        lambda: simulate_to_file("r.h5", rig, WHITE, sample_rate=20.0, duration=30.0, accuracy=1e-3),
    ):
        with pytest.raises(
            DivergedError, match=r"diverged near t = .* s at degree of freedom 'q1'"
        ) as caught:
            attempt()
        assert "\n" not in str(caught.value)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sample_rate": 0.0}, "sample_rate is 0.0; expected a positive number"),
        ({"sample_rate": math.nan}, "sample_rate is nan"),
        ({"duration": -1.0}, "duration is -1.0"),
        ({"duration": math.inf}, "duration is inf"),
        ({"duration": 0.001}, "has 0 samples and 3 output channels"),
        ({"n_runs": 0}, "n_runs is 0; expected a whole number of at least 1"),
        ({"n_runs": 1.5}, "n_runs is 1.5"),
        ({"seed": -1}, "seed is -1; expected a whole number of at least 0"),
        ({"accuracy": 0.0}, "accuracy is 0.0; expected a relative error from 1e-13"),
        ({"accuracy": 1.0}, "accuracy is 1.0"),
    ],
)
def test_settings_that_make_no_sense(settings, message):
    with pytest.raises(LabError, match=message):
        run(one(), WHITE, **settings)


def test_without_outputs_there_is_nothing_to_record():
    with pytest.raises(LabError, match="200 samples and 0 output channels"):
        run(one().connected(outputs=[]), WHITE)


def test_file_in_a_folder_that_does_not_exist(tmp_path):
    with pytest.raises(FileError, match=r"r\.h5"):
        simulate_to_file(tmp_path / "no" / "r.h5", one(), WHITE, sample_rate=20.0, duration=1.0)


def test_progress_counts_every_sample():
    for one_by_one in (False, True):
        seen = []
        settings = {
            "sample_rate": 20.0,
            "duration": 300.0,
            "n_runs": 2,
            "accuracy": 1e-3,
            "progress": seen.append,
        }
        if one_by_one:
            continue
        lab.simulate(one(), WHITE, **settings)
        assert sum(seen) == 2 * 6000
        assert len(seen) > 1


def test_recording_tells_where_it_comes_from():
    recording = run(one(), Pulse())
    assert recording.title == "oscillator"
    assert recording.sample_rate == 20.0
    assert [c.name for c in recording.inputs] == ["force"]
    assert [r.kind for r in recording.records] == ["pulse"]
    assert recording.attributes["simulation_substeps"] >= 1


def test_motion_shows_every_degree_of_freedom():
    rig = moving("chain3_coupled").connected(outputs=["acc1.x"])
    shown = motion(rig, Pulse(), sample_rate=20.0, duration=5.0)
    np.testing.assert_allclose(shown.time, np.arange(100) / 20)
    structure = LINEAR["chain3_coupled"][1]
    every = moving("chain3_coupled")
    forces = on_dofs(structure, rig.inputs, shown.inputs)
    exact = held_response(structure, every.outputs[3:6], 0.05, forces)
    # Accurate enough to look at.
    np.testing.assert_allclose(shown.position, exact, atol=1e-3 * np.max(np.abs(exact)))
    np.testing.assert_array_equal(shown.inputs[:, 0], [1, 0, 0])
