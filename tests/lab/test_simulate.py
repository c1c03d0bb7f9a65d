"""Simulated recordings against exact responses, through every kind of chain."""

import dataclasses
import math
import os
import sys

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import scipy.signal

import lab
from identification.systems import SecondOrder
from lab import excitation, stepping
from lab.chain import Chain
from lab.errors import DivergedError, FileError, LabError
from lab.excitation import Ambient, FreeDecay, Impact, Pulse, Random
from lab.files.recording import load
from lab.loads import Sampling
from lab.rig import Rig
from lab.simulate import DRIVE, motion, simulate_to_file
from lab.stages import Delay, Dropout, Gain, Hum, Lag, LowPass, Noise, Resolution, Saturation
from tests.lab.structures import (
    LINEAR,
    MODELS,
    chain_xml,
    held_response,
    moving,
    on_dofs,
    oscillator,
    true_error,
)

ONE = SecondOrder([[2.0]], [[0.4]], [[50.0]], ("x",))
WHITE = Random(rms=2.0)


def one(chain=None, **settings):
    rig = Rig.from_xml(oscillator(**settings)).connected(outputs=["pos", "vel", "acc.x"])
    return rig if chain is None else rig.with_chain(dataclasses.replace(chain, outputs=rig.chain.outputs))


def run(rig, drive, *, sample_rate=20.0, duration=10.0, **settings):
    return lab.simulate(rig, drive, sample_rate=sample_rate, duration=duration, **settings)


def same(a, b):
    """Whether two recordings agree to the last bit, missing samples included."""
    return len(a.records) == len(b.records) and all(
        np.array_equal(np.asarray(x.inputs), np.asarray(y.inputs), equal_nan=True)
        and np.array_equal(np.asarray(x.outputs), np.asarray(y.outputs), equal_nan=True)
        for x, y in zip(a.records, b.records, strict=True)
    )


# Accuracy.


def check_accuracy(recording, structure, accuracy):
    """The true error is within the accuracy, and within a factor of two of the error on record."""
    error, stated = true_error(recording, structure), recording.attributes["simulation_error"]
    assert error <= accuracy
    assert recording.attributes["simulation_accuracy"] == accuracy
    # Rounding puts a floor under both.
    assert stated / 2 - 1e-14 <= error <= 2 * stated + 1e-14


@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
@pytest.mark.parametrize("name", LINEAR)
def test_default_accuracy(name, drive):
    rate, structure = LINEAR[name]
    rig = moving(name)
    # Two inputs, for speed; all of them below.
    rig = rig.connected(inputs=[rig.inputs[0].name, rig.inputs[-1].name])
    check_accuracy(run(rig, drive, sample_rate=rate, duration=120 / rate, seed=3), structure, 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
@pytest.mark.parametrize("name", LINEAR)
def test_default_accuracy_of_every_channel_over_a_long_record(name, drive):
    rate, structure = LINEAR[name]
    check_accuracy(run(moving(name), drive, sample_rate=rate, duration=1000 / rate), structure, 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({path.stem for path in MODELS.glob("*.xml")} - set(LINEAR)))
def test_default_accuracy_of_any_other_linear_model(name):
    """Against the model's own truth, for models whose equations the tests do not write down."""
    rig = moving(name)
    if not rig.linear:
        pytest.skip("not linear: see the tests of the models")
    rate = float(4 * np.max(rig.modes().frequency_hz))
    recording = run(rig, WHITE, sample_rate=rate, duration=300 / rate)
    exact = rig.state_space().sampled(1 / rate).simulate(np.asarray(recording.records[0].inputs))
    error = relative(recording.records[0].outputs, exact)
    assert error <= 1e-9
    assert (
        recording.attributes["simulation_error"] / 2 <= error <= 2 * recording.attributes["simulation_error"]
    )


@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
@pytest.mark.parametrize("name", ["chain3_uncoupled", "chain3_coupled"])
def test_twelve_digits(name, drive):
    rate, structure = LINEAR[name]
    check_accuracy(run(moving(name), drive, sample_rate=rate, accuracy=1e-12), structure, 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
@pytest.mark.parametrize("name", ["chain7", "truss"])
def test_twelve_digits_of_larger_models(name, drive):
    rate, structure = LINEAR[name]
    rig = moving(name)
    rig = rig.connected(inputs=[c.name for c in rig.inputs[:3]])
    check_accuracy(run(rig, drive, sample_rate=rate, accuracy=1e-12), structure, 1e-12)


@pytest.mark.parametrize(("damping_ratio", "duration"), [(1e-3, 250.0), (0.0, 250.0)])
def test_errors_that_build_up_slowly_are_seen(damping_ratio, duration, monkeypatch):
    """A lightly damped mode gathers the error of many samples, long after the trial run."""
    # The trial run ends before the error does.
    monkeypatch.setattr(sys.modules["lab.simulate"], "MOST_PILOT_SAMPLES", 512)
    damping = 2 * damping_ratio * math.sqrt(2.0 * 50.0)
    rig, structure = one(damping=damping), dataclasses.replace(ONE, damping=[[damping]])
    recording = run(rig, Pulse(), sample_rate=4.0, duration=duration, accuracy=1e-6)
    error, stated = true_error(recording, structure), recording.attributes["simulation_error"]
    assert error <= 1e-6
    # Far from rounding, and honest; what the error may grow by after the trial run is an upper bound.
    assert error <= 1.1 * stated
    assert stated <= 10 * error


def test_accuracy_follows_the_noise():
    """The default is a thousandth of the smallest noise, relative to the largest value of the channel."""
    clean = run(one(), WHITE, seed=1).records[0].outputs
    for percent in (5.0, 0.1):
        noisy = run(one(Chain(acquisition=(Noise("vel", percent=percent),))), WHITE, seed=1)
        rms, largest = np.sqrt(np.mean(clean[1] ** 2)), np.max(np.abs(clean[1]))
        expected = 1e-3 * percent / 100 * rms / largest
        # The noise is judged on a coarse trial run.
        assert noisy.attributes["simulation_accuracy"] == pytest.approx(expected, rel=1e-3)
        assert noisy.attributes["simulation_error"] <= expected
    finest = run(one(Chain(acquisition=(Noise("*", percent=5.0), Resolution("pos", 1e-6)))), WHITE, seed=1)
    # Percent and rounding errors of one channel add up; the least disturbed channel counts.
    shares = [0.05 * np.sqrt(np.mean(y**2)) / np.max(np.abs(y)) for y in clean]
    assert finest.attributes["simulation_accuracy"] == pytest.approx(1e-3 * min(shares), rel=1e-3)


def test_an_accuracy_out_of_reach_is_refused():
    kinked = oscillator(
        extra='<tendon><fixed name="stop" stiffness="900" springlength="-1e6 0.05"><joint joint="x" coef="1"/></fixed></tendon>'
    )
    with pytest.raises(
        LabError, match=r"accuracy of 1.0e-13 is out of reach: the error is .* with \d+ substeps"
    ):
        run(Rig.from_xml(kinked), Random(rms=50.0), duration=0.3, accuracy=1e-13)


# Alignment and kinds of test.


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


def lagged_response(recording, time_constant, *, gain=1.0):
    """Response of the one mass to a force a with ȧ = (u - a) / τ, u held: position, acceleration."""
    u, dt = np.asarray(recording.records[0].inputs)[0], recording.dt
    F = np.zeros((4, 4))  # x, v, a, u
    F[0, 1] = 1
    F[1] = [-25, -0.2, gain / 2, 0]
    F[2] = [0, 0, -1 / time_constant, 1 / time_constant]
    step, state, y = scipy.linalg.expm(F * dt), np.zeros(3), []
    for value in u:
        full = np.append(state, value)
        y.append([state[0], F[1] @ full])
        state = (step @ full)[:3]
    return np.array(y).T


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


# The measurement chain.


def relative(found, exact):
    return np.max(np.abs(found - exact) / np.max(np.abs(exact), axis=1, keepdims=True))


def test_shaker_with_a_lag():
    """The accelerometer reads with the force at the instant, not with its mean over the substep that begins."""
    tau = 0.08
    rig = one(Chain(actuators=(Lag("force", 1 / (2 * np.pi * tau)),)))
    recording = run(rig, WHITE, accuracy=1e-7)
    exact = lagged_response(recording, tau)
    error = relative(recording.records[0].outputs[[0, 2]], exact)
    assert error <= 1e-7
    assert (
        recording.attributes["simulation_error"] / 3 <= error <= 2 * recording.attributes["simulation_error"]
    )


def test_instruments_with_a_memory_do_not_cost_their_accuracy():
    """Straight lines between substeps err by h², which extrapolation cancels: ten digits from a few substeps."""
    tau = 0.08
    rig = one(Chain(actuators=(Lag("force", 1 / (2 * np.pi * tau)),)))
    recording = run(rig, WHITE, accuracy=1e-10)
    assert relative(recording.records[0].outputs[[0, 2]], lagged_response(recording, tau)) <= 1e-10
    assert recording.attributes["simulation_substeps"] <= 40


def test_instruments_that_clip_are_still_followed():
    """A clipped force after a lag has kinks that cancel nothing; more substeps do."""
    rig = one(Chain(actuators=(Lag("force", 3.0), Saturation("force", 2.0))))
    recording = run(rig, WHITE, accuracy=1e-4)
    fine = run(rig, WHITE, accuracy=1e-5)
    assert relative(recording.records[0].outputs, fine.records[0].outputs) <= 1.1e-4
    assert recording.attributes["simulation_error"] <= 1e-4


def test_recorded_force_is_the_command_or_what_a_load_cell_saw():
    tau = 0.08
    actuators = (Lag("force", 1 / (2 * np.pi * tau)), Gain("force", -0.25))
    for measured in (False, True):
        recording = run(one(Chain(actuators=actuators, force_measured=measured)), Pulse(4.0), accuracy=1e-5)
        u = recording.records[0].inputs[0]
        if not measured:
            np.testing.assert_array_equal(u, [4.0, *[0.0] * 199])
            continue
        # Mean over each sample of 0.75 · 4 (1 - exp(-t / τ)), and of what is left of it later.
        dt, decay = 0.05, math.exp(-0.05 / tau)
        first = 3.0 * (1 - tau / dt * (1 - decay))
        later = 3.0 * (1 - decay) * tau / dt * (1 - decay) * decay ** np.arange(199)
        np.testing.assert_allclose(u, [first, *later], rtol=1e-10)


@pytest.mark.parametrize("delay", [0.05, 0.15, 0.02, 0.0137])
def test_shaker_with_a_delay(delay):
    """A delayed held force is the sum of two held forces: exact by splitting each sample where the force changes."""
    recording = run(one(Chain(actuators=(Delay("force", delay),))), WHITE, accuracy=1e-5)
    u = recording.records[0].inputs[0]
    whole = math.floor(delay / 0.05 + 1e-9)
    part = delay - 0.05 * whole
    late = np.concatenate([np.zeros(whole), u])
    F = np.array([[0, 1, 0], [-25, -0.2, 0.5], [0, 0, 0]])
    before, after = scipy.linalg.expm(F * part), scipy.linalg.expm(F * (0.05 - part))
    state, exact = np.zeros(2), []
    for k in range(u.size):
        acting = late[k] if part < 1e-9 else (late[k - 1] if k else 0.0)
        exact.append([*state, F[1] @ np.append(state, acting)])
        middle = (before @ np.append(state, acting))[:2]
        state = (after @ np.append(middle, late[k]))[:2]
    error = relative(recording.records[0].outputs, np.array(exact).T)
    assert error <= max(1e-5, 2 * recording.attributes["simulation_error"])


def filtered_response(recording, A, B, C, row):
    """One output of the one mass through an analog filter ẋ = A x + B y, exact for held forces."""
    u, dt, n = np.asarray(recording.records[0].inputs)[0], recording.dt, len(A)
    readings = np.array([[1, 0, 0], [0, 1, 0], [-25, -0.2, 0.5]])[row]  # of x, v, u
    F = np.zeros((n + 3, n + 3))  # x, v, u, filter
    F[0, 1] = 1
    F[1, :3] = [-25, -0.2, 0.5]
    F[3:, :3], F[3:, 3:] = np.outer(B, readings), A
    step, state, y = scipy.linalg.expm(F * dt), np.zeros(n + 3), []
    for value in u:
        state[2] = value
        y.append(C @ state[3:])
        state = step @ state
    return np.array(y)


@pytest.mark.parametrize("row", [0, 1, 2], ids=["position", "velocity", "acceleration"])
@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
def test_sensors_with_a_lag(row, drive):
    """Accelerations jump with the force; a filter that took them for continuous would be a sample late."""
    channel, tau = ("pos", "vel", "acc.x")[row], 0.03
    recording = run(one(Chain(sensors=(Lag(channel, 1 / (2 * np.pi * tau)),))), drive, accuracy=1e-6)
    exact = filtered_response(recording, np.array([[-1 / tau]]), np.array([1 / tau]), np.array([1.0]), row)
    error = relative(recording.records[0].outputs[[row]], exact[None])
    assert error <= 1e-6
    others = np.delete(recording.records[0].outputs, row, axis=0)
    ideal = np.delete(
        held_response(ONE, recording.outputs, recording.dt, np.asarray(recording.records[0].inputs)), row, 0
    )
    assert relative(others, ideal) <= 1e-6


def test_lagging_sensors_before_a_release():
    """Held still where it starts: a position has been there all the time, velocity and acceleration begin with the release."""
    tau, dt, x0, v0 = 0.08, 0.05, 0.3, -0.7
    sensors = tuple(Lag(channel, 1 / (2 * np.pi * tau)) for channel in ("pos", "vel", "acc.x"))
    recording = run(one(Chain(sensors=sensors)), FreeDecay({"x": x0}, {"x": v0}), accuracy=1e-7)
    F = np.zeros((5, 5))  # x, v and the filters of x, v, a
    F[0, 1], F[1, :2] = 1, [-25, -0.2]
    F[2, [0, 2]], F[3, [1, 3]] = [1 / tau, -1 / tau], [1 / tau, -1 / tau]
    F[4, [0, 1, 4]] = [-25 / tau, -0.2 / tau, -1 / tau]
    state, step, exact = np.array([x0, v0, x0, 0, 0]), scipy.linalg.expm(F * dt), []
    for _ in range(200):
        exact.append(state[2:])
        state = step @ state
    assert relative(recording.records[0].outputs, np.array(exact).T) <= 1e-7


def test_anti_alias_filter():
    corner, order = 8.0, 6
    recording = run(one(Chain(sensors=(LowPass("acc.x", corner, order),))), WHITE, accuracy=1e-6)
    b, a = scipy.signal.butter(order, 2 * np.pi * corner, analog=True)
    A, B, C, _ = scipy.signal.tf2ss(b, a)
    exact = filtered_response(recording, A, B[:, 0], C[0], 2)
    assert relative(recording.records[0].outputs[[2]], exact[None]) <= 1e-6


@pytest.mark.parametrize("delay", [0.05, 0.1, 0.0325])
def test_sensors_with_a_delay(delay):
    """Reading k is that of t_k - delay: exact by stepping to that instant from the sample before it."""
    stages = tuple(Delay(channel, delay) for channel in ("pos", "vel", "acc.x"))
    recording = run(one(Chain(sensors=stages)), WHITE, accuracy=1e-5)
    u, F = recording.records[0].inputs[0], np.array([[0, 1, 0], [-25, -0.2, 0.5], [0, 0, 0]])
    back = math.ceil(delay / 0.05 - 1e-9)
    part, step = scipy.linalg.expm(F * (0.05 * back - delay)), scipy.linalg.expm(F * 0.05)
    state, exact = np.zeros(3), np.zeros((3, u.size))
    for k in range(u.size - back):
        state[2] = u[k]
        there = part @ state
        exact[:, k + back] = [there[0], there[1], F[1] @ there]
        state = step @ state
    error = relative(recording.records[0].outputs, exact)
    assert error <= max(1e-5, 2 * recording.attributes["simulation_error"])


def test_stages_without_memory_act_on_the_exact_response():
    sensors = (Gain("pos", 0.1), Saturation("vel", 0.2), Hum("acc.x", 3.0, 0.5, 0.1))
    recording = run(one(Chain(sensors=sensors)), WHITE)
    exact = held_response(ONE, recording.outputs, 0.05, np.asarray(recording.records[0].inputs))
    t = np.arange(200) * 0.05
    expected = [
        1.1 * exact[0],
        np.clip(exact[1], -0.2, 0.2),
        exact[2] + 0.5 * np.sin(2 * np.pi * 3 * t + 0.1),
    ]
    assert np.any(np.abs(exact[1]) > 0.2)
    assert relative(recording.records[0].outputs, np.array(expected)) <= 2e-9


def test_clipped_shaker_still_gives_nine_digits():
    """Clipping a held force leaves a held force: no kink in time."""
    recording = run(one(Chain(actuators=(Saturation("force", 1.0),))), WHITE)
    clipped = np.clip(recording.records[0].inputs, -1, 1)
    assert (
        relative(recording.records[0].outputs, held_response(ONE, recording.outputs, 0.05, clipped)) <= 1e-9
    )


def test_noise_in_percent_of_each_channel():
    rig = one(Chain(acquisition=(Noise("*", percent=5.0),)))
    clean = run(one(), WHITE, duration=400.0, accuracy=1e-4)
    noisy = run(rig, WHITE, duration=400.0, accuracy=1e-4)
    added = noisy.records[0].outputs - clean.records[0].outputs
    share = np.std(added, axis=1) / np.sqrt(np.mean(clean.records[0].outputs ** 2, axis=1))
    # 8000 samples: the standard deviation scatters by 0.8 %; four of that.
    np.testing.assert_allclose(share, 0.05, rtol=0.032)
    assert np.max(np.abs(np.corrcoef(added) - np.eye(3))) < 4 / math.sqrt(8000)
    np.testing.assert_array_equal(noisy.records[0].inputs, clean.records[0].inputs)


def test_noise_of_force_sensors_is_on_the_recorded_input_only():
    rig = one(Chain(force_sensors=(Noise("force", std=0.3),), force_measured=True))
    clean, noisy = (run(r, WHITE, duration=400.0, accuracy=1e-4).records[0] for r in (one(), rig))
    np.testing.assert_array_equal(noisy.outputs, clean.outputs)
    assert np.std(noisy.inputs - clean.inputs) == pytest.approx(0.3, rel=0.032)


def test_dropouts_and_resolution():
    rig = one(Chain(acquisition=(Resolution("pos", 0.01), Dropout("vel", 0.1))))
    clean, real = (run(r, WHITE, duration=100.0, accuracy=1e-4).records[0] for r in (one(), rig))
    np.testing.assert_allclose(real.outputs[0] / 0.01, np.round(clean.outputs[0] / 0.01), atol=1e-9)
    lost = np.isnan(real.outputs[1])
    assert 0.05 < np.mean(lost) < 0.15
    np.testing.assert_array_equal(real.outputs[1][~lost], clean.outputs[1][~lost])
    assert not np.isnan(real.outputs[[0, 2]]).any()


def test_swapped_cables():
    """Channels carry each other's signal; what follows the cables stays with the channel."""
    acquisition = (Gain("pos", 1.0),)
    rig = one(Chain(swaps=(("pos", "vel"),), acquisition=acquisition))
    ideal, real = (run(r, WHITE, accuracy=1e-9).records[0].outputs for r in (one(), rig))
    np.testing.assert_array_equal(real, [2 * ideal[1], ideal[0], ideal[2]])


def test_noise_in_percent_follows_the_signal_that_the_cable_carries():
    rig = one(Chain(swaps=(("pos", "vel"),)))
    noisy = rig.with_chain(rig.chain.adding("acquisition", Noise("pos", percent=5.0)))
    clean, real = (run(r, WHITE, duration=400.0, accuracy=1e-4).records[0].outputs[0] for r in (rig, noisy))
    # 8000 samples: 0.8 % of scatter. Position and velocity differ by a factor of about five.
    assert np.std(real - clean) == pytest.approx(0.05 * np.sqrt(np.mean(clean**2)), rel=0.032)


def test_disturbances_push_without_being_recorded():
    rig = one(Chain(disturbances=(Hum("x", 1.5, 2.0, 0.3),)))
    recording = run(rig, WHITE)
    tone = 2.0 * np.sin(2 * np.pi * 1.5 * np.arange(200) * 0.05 + 0.3)
    exact = held_response(ONE, recording.outputs, 0.05, recording.records[0].inputs + tone)
    assert relative(recording.records[0].outputs, exact) <= 1e-9
    np.testing.assert_array_equal(recording.records[0].inputs, run(one(), WHITE).records[0].inputs)


# The same, however it is cut.

CHAINS = {
    "ideal": Chain(),
    "noisy": Chain(
        acquisition=(Noise("*", percent=5.0), Dropout("vel", 0.05)),
        force_sensors=(Noise("*", percent=1.0),),
        force_measured=True,
    ),
    "slow": Chain(
        actuators=(Lag("force", 3.0), Delay("force", 0.013)),
        sensors=(LowPass("acc.x", 4.0, 5), Delay("pos", 0.021), Hum("vel", 7.0, 0.1)),
        acquisition=(Noise("*", percent=1.0),),
    ),
}
DRIVES = {"pulse": Pulse(), "random": WHITE, "ambient": Ambient(), "free_decay": FreeDecay({"x": 1.0})}


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("chain", CHAINS)
def test_memory_and_file_hold_the_same_bits(chain, drive, tmp_path):
    settings = {"sample_rate": 20.0, "duration": 3.0, "n_runs": 2, "seed": 4, "accuracy": 1e-4}
    rig = one(CHAINS[chain])
    in_memory = lab.simulate(rig, DRIVES[drive], **settings)
    simulate_to_file(tmp_path / "r.h5", rig, DRIVES[drive], **settings)
    on_disk = load(tmp_path / "r.h5")
    assert same(in_memory, on_disk)
    assert on_disk.attributes == in_memory.attributes
    assert on_disk.inputs == in_memory.inputs
    assert on_disk.outputs == in_memory.outputs
    assert [r.kind for r in on_disk.records] == [r.kind for r in in_memory.records]
    assert (on_disk.title, on_disk.source) == (in_memory.title, in_memory.source)


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize("threads", [1, 3])
def test_threads_and_memory_do_not_matter(chain, threads, monkeypatch, tmp_path):
    settings = {"sample_rate": 20.0, "duration": 2.0, "n_runs": 3, "accuracy": 1e-3}
    rig = one(CHAINS[chain])
    expected = lab.simulate(rig, WHITE, **settings)
    monkeypatch.setattr(os, "cpu_count", lambda: threads)
    for chunk_bytes in (1, 100_000):
        monkeypatch.setattr(stepping, "CHUNK_BYTES", chunk_bytes)
        assert same(lab.simulate(rig, WHITE, **settings), expected)
    simulate_to_file(tmp_path / "r.h5", rig, WHITE, **settings)
    assert same(load(tmp_path / "r.h5"), expected)


@pytest.mark.parametrize("chain", ["ideal", "slow"])
@pytest.mark.parametrize("block", [1, 37])
def test_blocks_of_a_load_do_not_matter(chain, block, monkeypatch):
    """Without noise in percent, whose RMS is summed block by block, not even in the last bit."""
    rig = one(dataclasses.replace(CHAINS[chain], acquisition=()))
    expected = run(rig, WHITE, duration=5.0, accuracy=1e-4)
    monkeypatch.setattr(excitation, "BLOCK", block)
    assert same(run(rig, WHITE, duration=5.0, accuracy=1e-4), expected)


def test_long_records_run_through_many_blocks(tmp_path):
    """More samples than a block holds, in memory and into a file, against the exact response."""
    settings = {"sample_rate": 20.0, "duration": 210.0, "accuracy": 1e-5}
    rig = one(CHAINS["ideal"])
    recording = lab.simulate(rig, WHITE, **settings)
    assert recording.n_samples > excitation.BLOCK
    assert true_error(recording, ONE) <= 1e-5
    simulate_to_file(tmp_path / "r.h5", rig, WHITE, **settings)
    assert same(load(tmp_path / "r.h5"), recording)


def test_solver_with_dry_friction_is_cut_alike(monkeypatch, tmp_path):
    rig = Rig.from_xml(oscillator().replace('damping="0.4"', 'damping="0.4" frictionloss="0.1"'))
    settings = {"sample_rate": 20.0, "duration": 3.0, "n_runs": 2, "accuracy": 0.05}
    expected = lab.simulate(rig, WHITE, **settings)
    monkeypatch.setattr(stepping, "CHUNK_BYTES", 1)
    simulate_to_file(tmp_path / "r.h5", rig, WHITE, **settings)
    assert same(load(tmp_path / "r.h5"), expected)


# Seeds.


@pytest.mark.parametrize("chain", ["ideal", "noisy"])
def test_a_seed_fixes_every_bit(chain):
    rig, settings = one(CHAINS[chain]), {"duration": 2.0, "n_runs": 2, "accuracy": 1e-4}
    first = run(rig, WHITE, seed=7, **settings)
    assert same(first, run(rig, WHITE, seed=7, **settings))
    other = run(rig, WHITE, seed=8, **settings)
    for record in (*other.records, first.records[1]):
        assert not np.array_equal(record.inputs, first.records[0].inputs)


def test_noise_differs_between_records_channels_and_seeds():
    rig = one(Chain(acquisition=(Noise("*", std=1.0),)))
    noise = [
        record.outputs - run(one(), FreeDecay({"x": 1.0}), accuracy=1e-6).records[0].outputs
        for seed in (0, 1)
        for record in run(rig, FreeDecay({"x": 1.0}), n_runs=2, seed=seed, accuracy=1e-6).records
    ]
    rows = np.vstack(noise)
    # Twelve independent rows of 200 samples.
    assert np.max(np.abs(np.corrcoef(rows) - np.eye(12))) < 5 / math.sqrt(200)


def test_noise_of_a_channel_does_not_depend_on_the_others():
    rig = one(Chain(acquisition=(Noise("*", std=1.0),)))
    settings = {"duration": 5.0, "accuracy": 1e-6}
    every = run(rig, WHITE, **settings).records[0].outputs
    for names, rows in ((["acc.x"], [2]), (["vel", "pos"], [1, 0])):
        some = run(rig.connected(outputs=names), WHITE, **settings).records[0].outputs
        # The response may be stepped differently; the noise may not differ.
        np.testing.assert_allclose(some, every[rows], atol=1e-5)


def test_noise_of_a_record_does_not_depend_on_how_many_there_are():
    rig, settings = one(CHAINS["noisy"]), {"duration": 2.0, "accuracy": 1e-4}
    many = run(rig, WHITE, n_runs=3, **settings)
    few = run(rig, WHITE, n_runs=1, **settings)
    np.testing.assert_array_equal(few.records[0].outputs, many.records[0].outputs)


# Trouble.

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


# Round about.


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
